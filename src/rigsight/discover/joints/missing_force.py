"""The force missing at each joint of a rig as a regression: a joint is an element whose motion and force are known.

The motion follows the sensors, with a force of any shape at the joint: what the equations with some effects lack if they lack it
there alone. What wrong values of their parameters add to this force is projected out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.discover.joints.joint_motion import JointMotion, joint_motions
from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected, Regressed, rows_of
from rigsight.discover.support_starts import PlaceRegression
from rigsight.discover.terms.library import Candidate, candidates, distinct, offered_effects
from rigsight.discover.terms.monomials import LINEAR
from rigsight.effects import Effect, Place, placed
from rigsight.errors import SimulationError
from rigsight.identify import IdleThreads
from rigsight.identify.typical_size import typical_size
from rigsight.inverse import effect_force
from rigsight.inverse.joint_force import JointMotion as AlongJoint
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig, evaluated

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
        moved = AlongJoint(motion.record, motion.x, motion.v, motion.acceleration, rest, stiffness, load)
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
    """Return the force missing at each joint alone, by its name.

    The values are constants and parameters of the rig and of the effects, the noise is the floor of each output, and the fitted
    parameters are those whose influence is projected out.
    """
    try:
        motions = joint_motions(rig, records, values, noise, effects, fitted)
    except np.linalg.LinAlgError as error:
        raise SimulationError(
            f"The missing forces of {rig.name} cannot be found from its responses linearized about these records ({error})."
        ) from error
    return {
        motion.joint.name: MissingForce(
            motion, _regressed(motion, threads or IdleThreads()), dict(values), tuple(fitted)
        )
        for motion in motions
    }


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
