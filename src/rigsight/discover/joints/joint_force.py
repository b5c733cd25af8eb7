"""The force missing at each joint of a rig, the share of the sensor errors that it would explain, and its law.

For rigs of several joints, degrees of freedom, inputs or sensors. For each joint in turn, the whole missing force is assumed to
act there. Law and parameters of the rig are estimated together, and the joints are ranked by the likelihood of all sensor
readings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigsight.discover.joints.followed_motion import FollowedMotion, within_reach
from rigsight.discover.joints.joint_law import LawTerm, RegressedLaw, force_along, inclusion, regressed_laws
from rigsight.discover.joints.joint_motion import JointMotion, followed_again, joint_motions, noise_of
from rigsight.errors import InputError, SimulationError
from rigsight.identify.typical_size import typical_size
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import compose, simulate

_ROUNDS = 7
"""Alternating estimates of law and motion: parameters that were identified without the force are far off at first."""
_FOR_ALL = 3
"""Rounds for every joint; only joints that are not ruled out get further ones."""
_RULED_OUT = 3.0
"""Factor over the smallest sensor residual (RMS) at which a joint is ruled out."""
_SETTLED = 0.01
"""Relative change of parameters and coefficients below which the rounds have converged."""


@dataclass(frozen=True, eq=False)
class ForceTrace:
    """The missing force of a joint along one record, shape (n_samples,) each."""

    record: str
    t: Floats  # time [s]
    displacement: Floats  # of the joint from its rest, as its velocity
    velocity: Floats
    force: Floats  # resists the joint
    standard_error: Floats
    law: Floats  # the force according to the law


@dataclass(frozen=True, eq=False)
class JointLaw:
    """The law of a missing force."""

    terms: tuple[LawTerm, ...]  # the most significant first; empty if no term describes the force
    share: float  # of the force's mean square that they explain
    # Share of resampled data sets (stretches of the records, drawn at random) in which sparse regression selects a term, by the
    # name of the effect.
    inclusion: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class JointForce:
    """The force missing at one joint, if the whole missing force acts there."""

    joint: str  # its name
    x_unit: str  # of its motion
    unit: str  # of the force
    traces: tuple[ForceTrace, ...]  # force and motion, per record
    # Share of the weighted square of the rig's free-run errors that the force explains; all sensors together.
    share: float
    # Remaining sensor residual, RMS in units of the noise floors; far above 1, a force at this joint alone is not the cause.
    error_over_noise: float
    standard_error: float  # RMS of that of the force
    law: JointLaw  # the fitted law
    parameters: Mapping[str, float]  # the rig's own, estimated with the law
    criterion: float  # BIC of law, parameters and remaining unknown force; the smallest comes first

    @property
    def sentence(self) -> str:
        """The finding in words."""
        if not self.law.terms:
            return f"No function of the motion of {self.joint} describes the force missing there."
        reported = " and ".join(term.text for term in self.law.terms)
        return (
            f"The force missing at {self.joint} is best described by {reported}, which explains {self.law.share:.0%} (x and v of "
            f"the joint)."
        )

    def to_json(self) -> dict[str, Any]:
        """Return the entry of a file, without the traces."""
        return {
            "where": self.joint,
            "share": self.share,
            "error_in_noise_floors": self.error_over_noise,
            "standard_error": {"value": self.standard_error, "unit": self.unit},
            "criterion": self.criterion,
            "terms": [
                {**term.to_json(), "inclusion_probability": self.law.inclusion.get(term.effect.name)}
                for term in self.law.terms
            ],
            "share_of_force": self.law.share,
            "sentence": self.sentence,
        }


def missing_forces(
    rig: Rig,
    records: Sequence[Record],
    values: Mapping[str, float],
    noise: Mapping[str, float],
    rng: np.random.Generator | None = None,
) -> tuple[JointForce, ...]:
    """Return the force that would have to be missing at each joint; the most likely joint comes first.

    A sensor may be missing in some records. The values are constants and re-identified parameters, the noise is the floor of each
    output, and `rng` draws the ensemble for the inclusion probabilities of the first joint's terms; None leaves them out.
    """
    if not records:
        raise InputError("Finding a missing force needs at least one record; there is none.")
    floors = noise_of(rig, noise)
    found = joint_motions(rig, records, values, noise)
    before = _free_run_square(rig, records, values, floors, found[0].followed)
    laws: dict[str, RegressedLaw] = {}
    open_joints = found
    for number in range(_ROUNDS):
        open_joints, change = _improved(rig, open_joints, records, noise, laws)
        found = tuple(next((new for new in open_joints if new.joint is old.joint), old) for old in found)
        if number + 1 >= _FOR_ALL:
            least = min(one.remainder for one in open_joints)
            open_joints = tuple(one for one in open_joints if one.remainder <= _RULED_OUT**2 * least)
            if change < _SETTLED:
                break
    first = min(open_joints, key=lambda one: laws[one.joint.name].criterion)
    n_measured = sum(
        int(np.count_nonzero(m.residual == m.residual)) for m in first.followed.linearized(records)
    )
    included = (
        {first.joint.name: inclusion(first, floors, _sizes(first), laws[first.joint.name], rng)}
        if rng
        else {}
    )
    forces = [
        _joint_force(
            rig, one, records, laws[one.joint.name], before, n_measured, included.get(one.joint.name, {})
        )
        for one in found
    ]
    still_open = {one.joint.name for one in open_joints}
    return tuple(sorted(forces, key=lambda force: (force.joint not in still_open, force.criterion)))


def not_contradicted(forces: Sequence[JointForce]) -> tuple[JointForce, ...]:
    """Return the missing forces whose error over all sensors is at most a few times that of the best one."""
    least = min((force.error_over_noise for force in forces), default=0.0)
    return tuple(force for force in forces if force.error_over_noise <= _RULED_OUT * least)


def _improved(
    rig: Rig,
    found: Sequence[JointMotion],
    records: Sequence[Record],
    noise: Mapping[str, float],
    laws: dict[str, RegressedLaw],
) -> tuple[tuple[JointMotion, ...], float]:
    """Regress the law of each joint, adopt its parameters and estimate the motion again; return it and the largest change."""
    floors = noise_of(rig, noise)
    change = 0.0
    for one, law in zip(found, regressed_laws(found, floors, [_sizes(one) for one in found]), strict=True):
        changed = within_reach(one.followed, law.parameters)
        change = max(change, _change(one.followed, changed), _law_change(laws.get(one.joint.name), law))
        laws[one.joint.name] = law
        one.followed.values = changed
    return followed_again(
        [one.joint for one in found], [one.followed for one in found], records, noise
    ), change


def _change(followed: FollowedMotion, changed: Mapping[str, float]) -> float:
    before = followed.values
    return max(
        (
            abs(changed[p.name] - before[p.name]) / abs(before[p.name])
            for p in followed.fitted
            if before[p.name] != 0.0
        ),
        default=0.0,
    )


def _law_change(before: RegressedLaw | None, law: RegressedLaw) -> float:
    if before is None or [t.effect.name for t in before.terms] != [t.effect.name for t in law.terms]:
        return float("inf")
    pairs = [
        (old.values[name], value)
        for old, new in zip(before.terms, law.terms, strict=True)
        for name, value in new.values.items()
    ]
    return max((abs(new - old) / abs(new) for old, new in pairs if new != 0.0), default=0.0)


def _sizes(one: JointMotion) -> dict[str, float]:
    """Return the size of each base quantity at a joint."""
    x, v, force = (typical_size(own) for own in (one.displacement, one.velocity, one.force))
    return {"x": x, "time": x / v, "force": force, "drive": force}


def _free_run_square(
    rig: Rig, records: Sequence[Record], values: Mapping[str, float], noise: Floats, followed: FollowedMotion
) -> float:
    """Return the weighted sum of squares of the free-run errors of the rig's own equations, at most that of a rig at rest."""
    structure, total = compose(rig), 0.0
    others = np.setdiff1d(np.arange(followed.sizes.size), np.ravel(followed.forces))
    for record, motion in zip(records, followed.motions, strict=True):
        shown = [
            (record[s.name], floor) for s, floor in zip(rig.outputs, noise, strict=True) if s.name in record
        ]
        still = sum(float(np.sum(((y - np.mean(y)) / floor) ** 2)) for y, floor in shown)
        try:
            run = simulate(structure, values, record, motion[0, others], accuracy=1e-4)
        except SimulationError:
            total += still
            continue
        moving = sum(
            float(np.sum(((record[s.name] - run[s.name]) / floor) ** 2))
            for s, floor in zip(rig.outputs, noise, strict=True)
            if s.name in record
        )
        total += min(still, moving)
    return total


def _joint_force(
    rig: Rig,
    one: JointMotion,
    records: Sequence[Record],
    law: RegressedLaw,
    before: float,
    n_measured: int,
    included: Mapping[str, float],
) -> JointForce:
    reported = [
        sum((force_along(t, one, i, law.parameters) for t in law.terms), start=np.zeros(record.n_samples))
        for i, record in enumerate(records)
    ]
    traces = tuple(
        ForceTrace(r.name, r.t, x, v, force, error, own)
        for r, x, v, force, error, own in zip(
            records, one.displacement, one.velocity, one.force, one.error, reported, strict=True
        )
    )
    whole = sum(float(np.sum(trace.force**2)) for trace in traces)
    rest = sum(float(np.sum((trace.force - trace.law) ** 2)) for trace in traces)
    errors = np.concatenate(one.error)
    units = rig.units_at(one.joint.name)
    own = {p.name for p in rig.parameters}
    return JointForce(
        joint=one.joint.name,
        x_unit=units["x"],
        unit=units["force"],
        traces=traces,
        share=max(0.0, 1.0 - one.remainder / before) if before > 0.0 else 0.0,
        error_over_noise=float(np.sqrt(one.remainder / n_measured)),
        standard_error=float(np.sqrt(np.mean(errors**2))),
        law=JointLaw(law.terms, max(0.0, 1.0 - rest / whole) if law.terms and whole > 0.0 else 0.0, included),
        parameters={name: value for name, value in law.parameters.items() if name in own},
        criterion=law.criterion,
    )
