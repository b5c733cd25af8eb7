"""Terms and their regression on a rig of several joints: the force missing at each joint, as if it were missing there alone.

Terms of all joints compete in the same search. Before a term is added to an equation, the forces that this equation lacks are
estimated anew, so that terms at several joints are found one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from rigsight.discover.bench import Bench
from rigsight.discover.ensembles import Examined, inclusion, most_likely
from rigsight.discover.joints.missing_force import MissingForce, missing_forces
from rigsight.discover.regression import RegressionData
from rigsight.discover.result import Coefficient, ForceTrace, JointForce, JointTerm
from rigsight.discover.selection import Selection, criterion
from rigsight.discover.support_starts import PlaceRegression
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, swallowed_by_offsets, without_offsets
from rigsight.records.record import Record
from rigsight.simulate import compose

RULED_OUT = 3.0
"""Factor over the smallest sensor residual (RMS) of all joints above which a force at a joint alone is not the cause."""
_WORTH = 0.5
"""Share of a missing force that a term must explain to be reported as its law, at a joint without a term of the equation."""


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
            drawn = {}
            # Elsewhere the force would be a law only if the equation were wrong.
            if joint.name in own_joints or not own_joints:
                drawn = inclusion(again, place, most_likely(again, place, selection, final), rng)
            included |= drawn
            joints.append(_joint_force(again, place, force, selection, final, drawn))
        joints.sort(key=lambda own: (own.joint not in own_joints, own.error_over_noise))
        return Examined(included, joints=tuple(joints))


def _joint_force(
    bench: Bench,
    place: PlaceRegression,
    force: MissingForce,
    selection: Selection,
    final: FitResult,
    drawn: dict[str, float],
) -> JointForce:
    rig, motion = bench.rig, force.motion
    name, structure = motion.joint.name, final.structure
    law: list[tuple[Effect, dict[str, float], dict[str, float]]] = [
        (
            effect,
            structure.values_of(effect, {**dict(structure.fixed), **final.values}),
            {
                p.name: final.standard_errors.get(structure.parameter_name(effect, p.name), math.nan)
                for p in effect.parameters
            },
        )
        for effect in structure.effects
        if effect.at == name
    ] or _regressed_law(bench, place)
    units = rig.units_at(name)
    traces, n_measured = [], 0
    for i, record in enumerate(motion.records):
        along = [force.along(effect, own, i) for effect, own, _ in law]
        n_measured += sum(record.n_samples for signal in rig.outputs if signal.name in record)
        traces.append(
            ForceTrace(
                record.name,
                record.t,
                motion.displacement[i],
                motion.velocity[i],
                motion.force[i],
                motion.error[i],
                np.sum(along, axis=0) if along else np.zeros(record.n_samples),
            )
        )
    whole = sum(float(np.sum(trace.force**2)) for trace in traces)
    rest = sum(float(np.sum((trace.force - trace.law) ** 2)) for trace in traces)
    linear = next(trial.fit for trial in selection.trials if not trial.support)
    square = motion.remainder / n_measured
    there = [t for t in selection.trials if t.support and all(e.at == name for e in t.fit.structure.effects)]
    return JointForce(
        joint=name,
        x_unit=units["x"],
        unit=units["force"],
        traces=tuple(traces),
        share=max(0.0, 1.0 - square * linear.n_samples / linear.cost),
        error_over_noise=math.sqrt(square),
        standard_error=float(np.sqrt(np.mean(np.concatenate(motion.error) ** 2))),
        terms=tuple(
            JointTerm(
                effect,
                {
                    p.name: Coefficient(own[p.name], std.get(p.name, math.nan), rig.with_unit(p, name).unit)
                    for p in effect.parameters
                },
                drawn.get(effect.name),
            )
            for effect, own, std in law
        ),
        share_of_force=max(0.0, 1.0 - rest / whole) if law and whole > 0.0 else 0.0,
        criterion=criterion(there[0], selection.independent) if there else None,
    )


def _regressed_law(
    bench: Bench, place: PlaceRegression
) -> list[tuple[Effect, dict[str, float], dict[str, float]]]:
    """Return the term that explains most of a missing force with its parameters; nothing if none explains much."""
    shares = {n: place.projected.explained(bench.candidates[n].column[:, None])[1] for n in place.offered}
    best = max(shares, key=lambda name: shares[name], default="")
    if not best or shares[best] < _WORTH:
        return []
    structure = compose(bench.rig, [bench.candidates[best].effect])
    start = replace(bench, places=(place,), about=None).starts.regressed(structure, frozenset({best}))
    effect = bench.candidates[best].effect
    own = {p.name: start[structure.parameter_name(effect, p.name)] for p in effect.parameters}
    return [(effect, own, {})]
