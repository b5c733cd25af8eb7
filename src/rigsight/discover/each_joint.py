"""Terms and their regression on a rig of several joints: a joint is an element whose motion and force are known.

The motion follows the sensors, with a force of any shape at one joint: what the equations lack if they lack it there alone. What
wrong values of their parameters add to this force is projected out. Terms of all joints compete in the same search. Before a term
is added to an equation, the forces that this equation lacks are estimated anew, so that terms at several joints are found one
after the other.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from rigsight.discover.bench import Bench
from rigsight.discover.ensembles import Examined, inclusion, most_likely
from rigsight.discover.joint_motion import JointMotion, joint_motions
from rigsight.discover.library import Candidate, candidates, distinct, offered_effects
from rigsight.discover.monomials import LINEAR
from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected, Regressed, RegressionData, rows_of
from rigsight.discover.result import RULED_OUT, Coefficient, ForceTrace, JointForce, JointTerm
from rigsight.discover.selection import Selection, criterion
from rigsight.discover.support_starts import PlaceRegression
from rigsight.effects import Effect, Place, placed
from rigsight.errors import SimulationError
from rigsight.identify import FitResult, IdleThreads, swallowed_by_offsets, without_offsets
from rigsight.identify.typical_size import typical_size
from rigsight.inverse import effect_force
from rigsight.inverse.joint_force import JointMotion as AlongJoint
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig, evaluated
from rigsight.simulate import compose

_FACTOR = 3.0
"""Largest factor by which a regression changes a parameter; beyond, the linearized influence is not trusted."""


Same = Mapping[str, list[str]]


@dataclass(frozen=True, eq=False)
class MissingForce:
    """A joint with the force missing there, and the regression of this force."""

    motion: JointMotion
    regressed: Regressed
    known: Mapping[str, float]  # constants and parameters of the equations
    fitted: tuple[str, ...]  # parameters of the always included columns

    def place(self, rig: Rig, without: Collection[str]) -> tuple[PlaceRegression, list[Candidate], Same]:
        """Return the regression, its candidates without those of some names, and the terms that each of them replaces."""
        joint = self.motion.joint
        offered = [e for e in joint_effects(rig, joint) if placed(e, joint.name).name not in without]
        found = [
            replace(candidate, effect=placed(candidate.effect, joint.name))
            for candidate in candidates(offered, self.regressed)
            if np.all(np.isfinite(candidate.column)) and np.any(candidate.column)
        ]
        projected = self.regressed.projected
        library, same = distinct(found, projected)
        own = {p.name for p in (*rig.constants, *rig.parameters)}

        def rig_values(base: Floats) -> tuple[dict[str, float], float]:
            values = {name: value for name, value in self.known.items() if name in own}
            for name, change in zip(self.fitted, base, strict=True):
                if name in own:
                    low, high = sorted((values[name] / _FACTOR, values[name] * _FACTOR))
                    values[name] = float(np.clip(values[name] + change, low, high))
            return values, 1.0

        # Terms are added one by one, because the force is estimated anew beside each.
        return PlaceRegression(projected, tuple(c.name for c in library), rig_values, 1), library, same

    def along(self, effect: Effect, own: Mapping[str, float], index: int) -> Floats:
        """Return the force of an effect at this joint along a record, shape (n_samples,)."""
        joint, motion = self.motion.joint, self.regressed.motions[index]
        rest, stiffness = (evaluated(part, self.known) for part in (joint.rest, joint.stiffness))
        load = np.full_like(motion.x, np.nan)
        moved = AlongJoint(
            motion.record, motion.x, motion.v, motion.acceleration, rest, stiffness, load, load
        )
        return effect_force(effect, own, moved)


def joint_effects(rig: Rig, joint: Joint) -> list[Effect]:
    """Return the effects that can be terms of a regression at a joint, without their place."""
    declared = {
        "monomial_x0_v0": joint.force != 0 or joint.rest != 0,
        "monomial_x1_v0": joint.stiffness != 0,
        "monomial_x0_v1": joint.damping != 0,
    }
    linear = [effect for effect in LINEAR if not declared[effect.name]]
    offered = [e for e in offered_effects(rig, joint.stiffness != 0) if e.place is Place.DYNAMICS]
    return [effect for effect in (*offered, *linear) if rig.offers(placed(effect, joint.name))]


def missing_forces(
    rig: Rig,
    records: Sequence[Record],
    values: Mapping[str, float],
    noise: Mapping[str, float],
    fitted: Sequence[str],
    effects: Sequence[Effect] = (),
    threads: IdleThreads | None = None,
) -> dict[str, MissingForce]:
    """Return the force missing at each joint alone, by its name; not at one at which it runs away.

    The values are constants and parameters of the rig and of the effects, the noise is the floor of each output, and the fitted
    parameters are those whose influence is projected out.
    """
    try:
        motions = joint_motions(rig, records, values, noise, effects, fitted)
    except np.linalg.LinAlgError as error:
        raise SimulationError(
            f"The missing forces of {rig.name} cannot be found from its responses linearized about these records ({error})."
        ) from error
    found = {
        motion.joint.name: MissingForce(
            motion, _regressed(motion, threads or IdleThreads()), dict(values), tuple(fitted)
        )
        for motion in motions
        if math.isfinite(motion.remainder)
    }
    if not found:
        raise SimulationError(f"The equations of {rig.name} cannot be linearized near these records.")
    return found


def _regressed(found: JointMotion, threads: IdleThreads) -> Regressed:
    motions = [
        Motion(record, x, v, np.gradient(v, record.dt), x, force)
        for record, x, v, force in zip(
            found.records, found.displacement, found.velocity, found.force, strict=True
        )
    ]
    x, v, force = (typical_size(own) for own in (found.displacement, found.velocity, found.force))
    scales = {"x": x, "time": x / v, "force": force, "drive": force}
    rows = rows_of(motions, scales["time"])
    targets = [rows.of(motion.measured, motion.dt) for motion in motions]
    base = np.concatenate(
        [
            np.column_stack([np.zeros((target.size, 0)), *(rows.of(column, motion.dt) for column in own.T)])
            for own, motion, target in zip(found.by_parameter, motions, targets, strict=True)
        ]
    )
    independent = sum(
        target.size * rows.independent_share(0, motion.dt)
        for target, motion in zip(targets, motions, strict=True)
    )
    projected = Projected(base, np.concatenate(targets), max(independent, 10.0))
    return Regressed(motions, rows, projected, scales, False, threads)


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
            if joint.name not in found[key]:
                continue
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
    numbers = {**dict(structure.fixed), **final.values}
    law = [(e, structure.values_of(e, numbers)) for e in structure.effects if e.at == name]
    units = rig.units_at(name)
    traces, n_measured = [], 0
    for i, record in enumerate(motion.records):
        along = sum((force.along(e, own, i) for e, own in law), start=np.zeros(record.n_samples))
        n_measured += sum(record.n_samples for signal in rig.outputs if signal.name in record)
        signals = (motion.displacement[i], motion.velocity[i], motion.force[i], motion.error[i])
        traces.append(ForceTrace(record.name, record.t, *signals, along))
    whole = sum(float(np.sum(trace.force**2)) for trace in traces)
    rest = sum(float(np.sum((trace.force - trace.law) ** 2)) for trace in traces)
    linear = next(trial.fit for trial in selection.trials if not trial.support)
    square = motion.remainder / n_measured
    there = [t for t in selection.trials if t.support and all(e.at == name for e in t.fit.structure.effects)]
    terms = []
    for effect, own in law:
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
