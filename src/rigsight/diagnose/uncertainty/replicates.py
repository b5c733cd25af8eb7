"""Simulated outputs of a fitted model under another disturbance force and other sensor noise.

The force acts at the joints on the model with all its effects: while friction holds a mass it has no effect, when a mass is about
to slip a large one. The response is the difference to the same simulation without the force. An observer follows the measured
outputs, so other sensor noise also enters through its correction, and decays in it like an error of the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.pushes.probes import push
from rigsight.diagnose.uncertainty.sources import Sources
from rigsight.identify import FitResult
from rigsight.records.record import Record
from rigsight.rigs import Rig, Signal
from rigsight.simulate import (
    Structure,
    compose,
    parameter_vector,
    record_input,
    record_values,
    simulate_outputs,
    structure_of_fit,
)
from rigsight.simulate.input_hold import HeldInput, hold_input, hold_motion, together
from rigsight.simulate.prescribed_motion import smoothed_noise

Floats = NDArray[np.float64]
_Result = TypeVar("_Result")

_ACCURACY = 1e-5
"""Of simulations whose difference is the response: a tenth of what a fit asks for, as the response is small beside the motion."""


@dataclass(frozen=True)
class Replicates:
    """A fitted model along the records of its fit."""

    context: FitContext  # records and threads
    fit: FitResult  # of the model, to the context's estimation records

    @cached_property
    def _structure(self) -> Structure:
        own = self.fit.structure
        pushed = compose(with_forces(own.rig), own.effects, dict(own.fixed))
        return structure_of_fit(pushed, self.context.estimation)

    @cached_property
    def _undisturbed(self) -> list[tuple[Floats, int]]:
        """Readings of each record without a force, and their number of integration steps."""

        def of_record(index: int) -> tuple[Floats, int]:
            record = self.context.estimation[index]
            quiet = np.zeros((record.n_samples, len(self.fit.structure.rig.mechanism.joints)))
            # Band-limited inputs have up to two pieces in a sample.
            taken = np.zeros(2 * record.n_samples, dtype=np.intc)
            return self._outputs(index, quiet, taken=taken), int(np.sum(taken))

        return self._of_each_record(of_record)

    @property
    def n_steps(self) -> int:
        """Integration steps of one replicate: a measure of its cost that does not depend on the computer."""
        return sum(steps for _, steps in self._undisturbed)

    def responses(self, forces: Sequence[Floats]) -> list[Floats]:
        """Return the change of the residuals of each record by forces at the joints."""
        return self._of_each_record(lambda i: self._response(i, forces[i], None))

    def with_noise(self, noise: Sequence[Floats]) -> list[Floats]:
        """Return how sensor noise changes the residuals of each record: the noise itself less the response of the observer."""
        return self._of_each_record(lambda i: self._changed(i, None, noise[i]))

    def drawn(self, sources: Sources, n_replicates: int, rng: np.random.Generator) -> list[Floats]:
        """Return random changes of the residuals of each record for forces and sensor noise of these sizes."""
        forces = [sources.forces(r.n_samples, r.dt, n_replicates, rng) for r in self.context.estimation]
        noise = [sources.noise(r.n_samples, n_replicates, rng) for r in self.context.estimation]
        return self._of_each_record(lambda i: self._changed(i, forces[i], noise[i]))

    def _changed(self, index: int, force: Floats | None, noise: Floats) -> Floats:
        record = self.context.estimation[index]
        if force is None:
            if not record.observed:
                return noise
            force = np.zeros((record.n_samples, len(self.fit.structure.rig.mechanism.joints), noise.shape[2]))
        # The residual is the reading less its prediction. A force changes the reading; the prediction of an observer tracks the
        # noise.
        sign = -1.0 if record.observed else 1.0
        return noise + sign * self._response(index, force, noise)

    def _response(self, index: int, force: Floats, noise: Floats | None) -> Floats:
        quiet, _ = self._undisturbed[index]
        found = [
            self._outputs(index, own, None if noise is None else noise[:, :, i]) - quiet
            for i, own in enumerate(np.moveaxis(force, 2, 0))
        ]
        return np.stack(found, axis=2)

    def _of_each_record(self, one: Callable[[int], _Result]) -> list[_Result]:
        return self.context.threads.results(one, [record.n_samples for record in self.context.estimation])

    def _outputs(
        self,
        index: int,
        force: Floats,
        noise: Floats | None = None,
        taken: NDArray[np.intc] | None = None,
    ) -> Floats:
        """Return the readings of a record under forces, shape (n_samples, n_outputs)."""
        structure, record = self._structure, self.context.estimation[index]
        joints = [push(joint.name) for joint in self.fit.structure.rig.mechanism.joints]
        signals = {**record.signals, **dict(zip(joints, force.T, strict=True))}
        held = record_input(structure, replace(record, signals=signals))
        if noise is not None and record.observed:
            held = held.plus(self._observed_noise(record, noise))
        p = parameter_vector(structure, record_values(structure, self.fit.values, record))
        state = self.fit.initial_states[index]
        steps = None if taken is None else taken[: held.n_pieces]
        return simulate_outputs(structure, held, p, state, record.n_samples, _ACCURACY, steps)

    def _observed_noise(self, record: Record, noise: Floats) -> HeldInput:
        """Return what noise of the sensors changes of all inputs: the motion that an observer follows."""
        structure = self._structure
        names = [signal.name for signal in self.fit.structure.rig.outputs]
        nothing = hold_input(np.zeros(record.n_samples), record.dt, record.hold)
        observed = [
            hold_motion(*smoothed_noise(record[name], noise[:, names.index(name)], record.dt), record.dt)
            if name in record.observed
            else nothing
            for name in structure.observed
        ]
        return together([*(nothing for _ in structure.rig.mechanism.inputs), *observed])


def with_forces(rig: Rig) -> Rig:
    """Return a rig with a force at every joint; each is an input, see `push`."""
    # It stands in the joint's own force, so that a sensor which reads that force shows it.
    mechanism = rig.mechanism
    names = tuple(push(joint.name) for joint in mechanism.joints)
    joints = tuple(
        replace(joint, force=joint.force - sp.Symbol(push(joint.name), real=True))
        for joint in mechanism.joints
    )
    return replace(
        rig,
        name=f"{rig.name} with forces at its joints",
        inputs=(*rig.inputs, *(Signal(name, "", "") for name in names)),
        mechanism=replace(mechanism, inputs=(*mechanism.inputs, *names), joints=joints),
    )
