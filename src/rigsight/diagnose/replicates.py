"""Simulated outputs of a fitted model under another disturbance force and other sensor noise.

The force acts at the joints on the model with all its effects: while friction holds a mass it has no effect, when a mass is about
to slip a large one. The response is the difference to the same simulation without the force. An observer follows the measured
outputs, so other sensor noise also enters through its correction, and decays in it like an error of the motion.

Forces and noise that explain the residual: white noise of each sensor and a force at each joint, the sum of white noise and
of low-pass noise with several corner frequencies. The response of each sensor to each of them is simulated, less what initial
states and parameters compensate in a fit; the sizes follow by maximum likelihood of the spectra. Sticking friction hides a force,
so the sizes are corrected once by simulating the result.

References
----------
P. Whittle, Ark. Mat. 2 (1953) 423, for the likelihood of a spectrum. C. Fevotte, N. Bertin and J.-L. Durrieu, Neural Comput. 21
(2009) 793, for its maximum over sums of given spectra. C. Gourieroux, A. Monfort and E. Renault, J. Appl. Econometrics 8 (1993)
S85, for sizes that are corrected by simulation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.signal.windows import tukey

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.pushes.probes import push
from rigsight.identify import FitResult
from rigsight.records.record import Floats, Record
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

SLOWER = (1.0, 0.1, 0.01)
"""Corners of forces that are not white, in units of the rig's typical angular frequency: at the resonance a force with the first
corner is half as strong as below it; the last one is nearly constant in most records. What lies between is a sum of them."""
_AVERAGED = 9
"""Lines that are averaged: 18 degrees of freedom, a scatter of a third. The first ones, where a slow force stands, are averaged
over as many as lie below them."""
_TAPER = 0.1
"""Share of a record that is faded in and out: 10 percent is usual, so that slow errors do not leak into fast ones."""
FEWEST = 4 * _AVERAGED
"""Samples of a record below which its spectrum would be one average."""
_ROUNDS = 400
"""Of multiplicative updates; in trials powers of a percent of the remainder had settled after 200."""
_NOTHING = 1e-12


@dataclass(frozen=True)
class Sources:
    """Sizes of disturbance forces and sensor noise."""

    noise_std: Floats  # of each sensor's white noise, shape (n_outputs,)
    # Of the force at each joint by corner frequency, shape (n_joints, n_corners), in the unit of the joint's
    # force.
    force_std: Floats
    # Corner frequencies of the low-pass noise [rad/s], infinite for white forces, shape (n_corners,).
    corners: Floats

    def noise(self, n_samples: int, n_replicates: int, rng: np.random.Generator) -> Floats:
        """Draw noise of the sensors, shape (n_samples, n_outputs, n_replicates)."""
        white = rng.standard_normal((n_samples, self.noise_std.size, n_replicates))
        return np.asarray(white * self.noise_std[:, None])

    def forces(self, n_samples: int, dt: float, n_replicates: int, rng: np.random.Generator) -> Floats:
        """Draw forces at the joints, shape (n_samples, n_joints, n_replicates)."""
        total = np.zeros((n_samples, self.force_std.shape[0], n_replicates))
        for corner, size in zip(self.corners, self.force_std.T, strict=True):
            if np.any(size > 0.0):
                total += size[:, None] * colored(total.shape, corner * dt, rng)
        return total


def colored(shape: tuple[int, ...], corner: float, rng: np.random.Generator) -> Floats:
    """Draw low-pass forces of variance 1 with a corner [rad per sample], white ones for an infinite corner; time is axis 0."""
    white = rng.standard_normal(shape)
    pole = np.exp(-corner)
    white[1:] *= np.sqrt(1.0 - pole**2)
    return np.asarray(lfilter([1.0], [1.0, -pole], white, axis=0))


def likeliest_sources(
    remainder: Sequence[Floats],
    of_noise: Sequence[Sequence[tuple[Floats, Floats]]],
    of_forces: Sequence[Sequence[tuple[Floats, Floats]]],
    dts: Sequence[float],
    corners: Floats,
) -> Sources:
    """Return the maximum likelihood sizes of sources from the spectra of a residual."""
    long = [i for i, own in enumerate(remainder) if own.shape[0] >= FEWEST]
    if not long:
        raise ValueError("No record is long enough for a spectrum.")
    n_outputs, n_joints = remainder[0].shape[1], len(of_forces)
    powers, gains, weights = [], [], []
    for i in long:
        seen = np.any(remainder[i] != 0.0, axis=0)
        power = _power(remainder[i][:, :, None])
        omega = 2.0 * np.pi * np.arange(power.shape[0]) / (remainder[i].shape[0] * dts[i])
        colors = np.column_stack([_color(omega, corner, dts[i]) for corner in corners])
        own = np.zeros((*power.shape, n_outputs + n_joints * corners.size))
        for sensor in range(n_outputs):
            own[:, :, sensor] = _gain(*of_noise[sensor][i])
        for joint in range(n_joints):
            gain = _gain(*of_forces[joint][i])
            columns = slice(n_outputs + joint * corners.size, n_outputs + (joint + 1) * corners.size)
            own[:, :, columns] = gain[:, :, None] * colors[:, None, :]
        starts = _starts(power.shape[0])
        counts = np.diff([*starts, power.shape[0]]).astype(np.float64)
        powers.append((np.add.reduceat(power[:, seen], starts) / counts[:, None]).ravel())
        gains.append(
            (np.add.reduceat(own[:, seen], starts) / counts[:, None, None]).reshape(-1, own.shape[2])
        )
        # The mean has one degree of freedom, any other line two.
        counts[0] -= 0.5
        weights.append(np.repeat(counts, np.count_nonzero(seen)))
    found = np.sqrt(_likeliest(np.concatenate(powers), np.concatenate(gains), np.concatenate(weights)))
    return Sources(found[:n_outputs], found[n_outputs:].reshape(n_joints, corners.size), corners)


def _likeliest(power: Floats, gains: Floats, weights: Floats) -> Floats:
    """Return the maximum likelihood powers of sources, shape (n_sources,), from averaged spectral lines, shape (n,)."""
    # Each update lowers the weighted sum of ``log(expected) + power / expected`` and keeps powers positive.
    size = float(np.mean(power))
    mean = np.asarray(np.mean(gains, axis=0), dtype=np.float64)
    shows = mean > 0.0
    share = size / max(int(np.count_nonzero(shows)), 1)
    found = np.where(shows, share / np.where(shows, mean, 1.0), 0.0)
    for _ in range(_ROUNDS):
        expected = gains @ found + _NOTHING * size
        wanted, had = gains.T @ (weights * power / expected**2), gains.T @ (weights / expected)
        found = np.where(shows, found * np.sqrt(wanted / np.where(had > 0.0, had, 1.0)), 0.0)
    return np.asarray(found)


def _power(columns: Floats) -> Floats:
    """Return the power of each line, averaged over replicates, shape (n_lines, n_outputs); white noise has its variance."""
    n = columns.shape[0]
    window = tukey(n, _TAPER)
    lines = np.abs(np.fft.rfft(columns * window[:, None, None], axis=0)) ** 2 / np.sum(window**2)
    return np.asarray(np.mean(lines, axis=2))


def _gain(drawn: Floats, remainder: Floats) -> Floats:
    """Return the power of each line over that which was drawn and not the expected one: a linear response then has no scatter."""
    seen, whole = _power(remainder), _power(drawn[:, None, :])
    # A force that no sensor shows has no gain, also at a line that was not drawn.
    return np.divide(seen, whole, out=np.zeros_like(seen), where=seen > 0.0)


def _starts(n_lines: int) -> list[int]:
    """Return where groups of adjacent lines begin, each as long as what lies below it up to a limit."""
    starts, edge = [0], 1
    while edge < n_lines:
        starts.append(edge)
        edge += min(edge, _AVERAGED)
    return starts


def _color(omega: Floats, corner: float, dt: float) -> Floats:
    """Return the spectrum of `colored`, shape as given."""
    pole = np.exp(-corner * dt)
    return np.asarray((1.0 - pole**2) / np.abs(1.0 - pole * np.exp(-1j * omega * dt)) ** 2)


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
        self, index: int, force: Floats, noise: Floats | None = None, taken: NDArray[np.intc] | None = None
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
