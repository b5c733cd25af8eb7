"""Terms and their regression on a rig of several joints: the force missing at each joint, as if it were missing there alone.

Terms of all joints compete in the same search. Before a term is added to an equation, the forces that this equation lacks are
estimated anew, so that terms at several joints are found one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from rigsight.discover.bench import Bench
from rigsight.discover.ensembles import Examined, inclusion, most_likely
from rigsight.discover.joints.missing_force import MissingForce, missing_forces
from rigsight.discover.regression import RegressionData
from rigsight.discover.result import RULED_OUT, Coefficient, ForceTrace, JointForce, JointTerm
from rigsight.discover.selection import Selection, criterion
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, swallowed_by_offsets, without_offsets
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose


@dataclass(frozen=True, eq=False)
class EachJoint:
    """The regressions of a rig of several joints."""

    data: RegressionData
    begun: Bench  # without a library, which needs the equations without any term to be fitted
    same: dict[str, list[str]] = field(default_factory=dict)  # terms that the records do not distinguish

    form: ClassVar[str] = "linearized responses"

    @classmethod
    def of(cls, data: RegressionData, bench: Bench) -> EachJoint:
        """Hold the parameters that offsets of the records replace."""
        structure = compose(bench.rig)
        asked = bench.free_parameters(structure)
        swallowed = swallowed_by_offsets(
            structure, bench.estimation, bench.scales, bench.noise, bench.values, asked
        )
        return cls(data, replace(bench, held=bench.held | frozenset(swallowed)))

    def about(self, bench: Bench, fit: FitResult) -> Bench:
        """Return the bench with the regression of the force that a fitted equation lacks at each joint."""
        if bench.about is fit:
            return bench
        try:
            forces = self._forces(bench, bench.estimation, fit, fit.structure.effects, fit.free)
        except SimulationError:
            if bench.about is None:
                raise
            return bench
        places, candidates = [], dict(bench.candidates)
        # A term that stands for others does so in every regression.
        without = {*fit.structure.effect_names}.union(*self.same.values())
        least = min(force.motion.remainder for force in forces.values())
        for force in forces.values():
            if force.motion.remainder > RULED_OUT**2 * least:
                continue
            place, library, same = force.place(bench.rig, without)
            places.append(place)
            candidates |= {candidate.name: candidate for candidate in library}
            for name, others in same.items():
                self.same.setdefault(name, []).extend(others)
        return replace(bench, candidates=candidates, places=tuple(places), about=fit)

    def _forces(
        self,
        bench: Bench,
        records: Sequence[Record],
        fit: FitResult,
        effects: Sequence[Effect],
        fitted: Sequence[str],
    ) -> dict[str, MissingForce]:
        """Return the forces missing beside some effects of a fitted equation."""
        values, names = dict(bench.values), set(compose(bench.rig, effects).names)
        if math.isfinite(fit.cost):
            values |= {**dict(fit.structure.fixed), **fit.values}
            records = without_offsets(records, fit)
        free = [name for name in fitted if name in names]
        return missing_forces(bench.rig, records, values, bench.noise, free, effects, bench.threads)

    def examined(
        self, bench: Bench, selection: Selection, final: FitResult, rng: np.random.Generator
    ) -> Examined:
        """Return the force missing at each joint with the final parameters, and the inclusion probabilities of its terms."""
        records = [record for record in self.data.records if record.role == "estimation"]
        effects = final.structure.effects
        own_joints = {effect.at for effect in effects}
        represented = set[str]().union(*self.same.values()) - {*final.structure.effect_names}
        found: dict[tuple[str, ...], dict[str, MissingForce]] = {}
        included: dict[str, float] = {}
        joints = []
        for joint in bench.rig.mechanism.joints:
            others = [e for e in effects if joint.name in own_joints and e.at != joint.name]
            key = tuple(effect.name for effect in others)
            if key not in found:
                found[key] = self._forces(bench, records, final, others, final.free)
            force = found[key][joint.name]
            place, library, _ = force.place(bench.rig, represented)
            again = replace(
                bench, candidates={**bench.candidates, **{c.name: c for c in library}}, places=[place]
            )
            # Elsewhere a term would explain the force only if the equation were wrong.
            if joint.name in own_joints or not own_joints:
                included |= inclusion(again, place, most_likely(again, place, selection, final), rng)
            joints.append(_joint_force(bench.rig, force, selection, final, included))
        joints.sort(key=lambda own: (own.joint not in own_joints, own.error_over_noise))
        return Examined(included, joints=tuple(joints))


def _joint_force(
    rig: Rig, force: MissingForce, selection: Selection, final: FitResult, included: Mapping[str, float]
) -> JointForce:
    motion, structure, name = force.motion, final.structure, force.motion.joint.name
    law = {
        effect: structure.values_of(effect, {**dict(structure.fixed), **final.values})
        for effect in structure.effects
        if effect.at == name
    }
    units = rig.units_at(name)
    traces, n_measured = [], 0
    for i, record in enumerate(motion.records):
        along = sum((force.along(e, own, i) for e, own in law.items()), start=np.zeros(record.n_samples))
        n_measured += sum(record.n_samples for signal in rig.outputs if signal.name in record)
        signals = (motion.displacement[i], motion.velocity[i], motion.force[i], motion.error[i])
        traces.append(ForceTrace(record.name, record.t, *signals, along))
    whole = sum(float(np.sum(trace.force**2)) for trace in traces)
    rest = sum(float(np.sum((trace.force - trace.law) ** 2)) for trace in traces)
    linear = next(trial.fit for trial in selection.trials if not trial.support)
    square = motion.remainder / n_measured
    there = [t for t in selection.trials if t.support and all(e.at == name for e in t.fit.structure.effects)]
    terms = []
    for effect, own in law.items():
        errors = {
            p.name: final.standard_errors.get(structure.parameter_name(effect, p.name), math.nan)
            for p in effect.parameters
        }
        coefficients = {
            p.name: Coefficient(own[p.name], errors[p.name], rig.with_unit(p, name).unit)
            for p in effect.parameters
        }
        terms.append(JointTerm(effect, coefficients, included.get(effect.name)))
    return JointForce(
        joint=name,
        x_unit=units["x"],
        unit=units["force"],
        traces=tuple(traces),
        share=max(0.0, 1.0 - square * linear.n_samples / linear.cost),
        error_over_noise=math.sqrt(square),
        standard_error=float(np.sqrt(np.mean(np.concatenate(motion.error) ** 2))),
        terms=tuple(terms),
        share_of_force=max(0.0, 1.0 - rest / whole) if law and whole > 0.0 else 0.0,
        criterion=criterion(there[0], selection.independent) if there else None,
    )
