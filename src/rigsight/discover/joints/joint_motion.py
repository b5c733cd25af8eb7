"""The force at one joint alone with which a rig would follow its sensors, and the motion of that joint.

First all joints have an unknown force, so that the motion follows the sensors wherever the missing force acts. Then only one
joint at a time has an unknown force: the remaining sensor errors are evidence against this joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.discover.joints.followed_motion import (
    DECADES,
    FollowedMotion,
    force_by_parameter,
    improved,
    joint_motion,
    with_unknown_forces,
)
from rigsight.discover.joints.linearized_motion import LinearizedMotion, MotionEquations
from rigsight.effects import Effect
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig
from rigsight.simulate import compose, parameter_vector, record_input, rest_state
from rigsight.simulate.equations.derivatives import slope
from rigsight.simulate.simulation import record_values

_PASSES = 4
_SETTLED = 1e-2
"""Change of the motion, in units of its sizes, below which the linearization has converged."""
_AT_REST = 0.02
"""Share of a joint's RMS velocity below which it may stick: dry friction then has any value that holds the joint, and it jumps
when the motion reverses."""


@dataclass(frozen=True, eq=False)
class JointMotion:
    """One joint, if the unknown force acts there alone; signals of shape (n_samples,) per record."""

    joint: Joint
    followed: FollowedMotion  # the rig with the unknown force there
    records: tuple[Record, ...]  # the measured records
    displacement: tuple[Floats, ...]  # of the joint from its rest, as its velocity
    velocity: tuple[Floats, ...]
    force: tuple[Floats, ...]  # the unknown force that resists it
    error: tuple[Floats, ...]  # its standard error
    # What a unit too much of each fitted parameter adds to the force, shape (n_samples, n_parameters).
    by_parameter: tuple[Floats, ...]
    remainder: float  # weighted sum of squares of the sensor residuals of this motion


def noise_of(rig: Rig, noise: Mapping[str, float]) -> Floats:
    """Return the noise floor of each output, shape (n_outputs,); 1 for a sensor in no record, where it has no influence."""
    return np.array([noise.get(signal.name, 1.0) for signal in rig.outputs])


def joint_motions(
    rig: Rig,
    records: Sequence[Record],
    values: Mapping[str, float],
    noise: Mapping[str, float],
    effects: Sequence[Effect] = (),
    fitted: Sequence[str] = (),
) -> tuple[JointMotion, ...]:
    """Return each joint with the unknown force that would have to act there alone, in the order of the rig.

    The force is that beside some effects. The values are constants and re-identified parameters, the noise is the floor of each
    output; the influence of fitted parameters on the force is returned as well.
    """
    floors = noise_of(rig, noise)
    joints = rig.mechanism.joints
    every = _at_every_joint(rig, effects, records, dict(values), floors)
    n_own = every.sizes.size - 2 * len(joints)
    alone = []
    for index, joint in enumerate(joints):
        size = every.sizes[n_own + 2 * index : n_own + 2 * index + 2]
        equations, forces = with_unknown_forces(rig, effects, [joint.name], fitted)
        columns = [*range(n_own), n_own + 2 * index, n_own + 2 * index + 1]
        motions = [motion[:, columns] for motion in every.motions]
        sizes = np.append(every.sizes[:n_own], size)
        alone.append(FollowedMotion(equations, forces, dict(values), motions, sizes, every.omega))
    improved(alone, records, floors, DECADES)
    # Estimated again about this motion; the force may jump where the joint rests.
    for joint, one in zip(joints, alone, strict=True):
        one.jumps = list(_resting(joint, one, records))
    improved(alone, records, floors, DECADES)
    nothing = [np.zeros((record.n_samples, 0)) for record in records]
    changes = force_by_parameter(alone, records, floors) if fitted else [nothing for _ in joints]
    return tuple(
        _found(joint, one, records, floors, change)
        for joint, one, change in zip(joints, alone, changes, strict=True)
    )


def _at_every_joint(
    rig: Rig,
    effects: Sequence[Effect],
    records: Sequence[Record],
    values: dict[str, float],
    noise: Floats,
) -> FollowedMotion:
    """Return the motion that follows the sensors with an unknown force at every joint."""
    joints = rig.mechanism.joints
    equations, forces = with_unknown_forces(rig, effects, [joint.name for joint in joints], ())
    structure = compose(rig, effects)
    rest = [
        rest_state(
            structure,
            parameter_vector(structure, record_values(structure, values, record)),
            record_input(structure, record),
        )
        for record in records
    ]
    # The forces, which are the last states, begin at zero: an equilibrium with them would be searched for in vain.
    nothing = np.zeros(2 * len(joints))
    motions = [
        np.tile(np.append(state, nothing), (record.n_samples, 1))
        for state, record in zip(rest, records, strict=True)
    ]
    linear = equations.about(records[0], values, motions[0])
    omega = _typical_rate(rig, records, noise)
    sizes = _sizes(rig, equations, forces, records, values, linear, omega)
    followed = FollowedMotion(equations, forces, values, motions, sizes, omega)
    improved([followed], records, noise, DECADES)
    for _ in range(_PASSES):
        if improved([followed], records, noise, (followed.decade,)) < _SETTLED:
            break
    return followed


def _typical_rate(rig: Rig, records: Sequence[Record], noise: Floats) -> float:
    """Return the angular frequency at which the sensors' readings change [rad/s]."""
    found = []
    for signal, floor in zip(rig.outputs, noise, strict=True):
        for record in records:
            if signal.name in record and record.n_samples > 2:
                shown = record[signal.name]
                power = np.var(np.gradient(shown, record.dt)) - floor**2 / (2.0 * record.dt**2)
                spread = np.var(shown) - floor**2
                if power > 0.0 and spread > 0.0:
                    found.append(float(np.sqrt(power / spread)))
    longest = max(record.dt * record.n_samples for record in records)
    return float(np.median(found)) if found else 2.0 * np.pi / longest


def _sizes(
    rig: Rig,
    equations: MotionEquations,
    forces: Sequence[tuple[int, int]],
    records: Sequence[Record],
    values: Mapping[str, float],
    linear: LinearizedMotion,
    omega: float,
) -> Floats:
    """Return the size of every state: from sensors of the state, its rate or its coordinate, else from the other states."""
    seen = np.max(np.abs(linear.seen), axis=0)
    spreads = np.array(
        [max((float(np.std(r[s.name])) for r in records if s.name in r), default=0.0) for s in rig.outputs]
    )
    n, n_states = len(rig.mechanism.free), seen.shape[1]
    shown = np.divide(spreads[:, None], seen, out=np.zeros_like(seen), where=seen > 0.0)
    size = np.max(shown, axis=0, initial=0.0)
    size[:n] = np.maximum(size[:n], size[n : 2 * n] / omega)
    moving = size[:n][size[:n] > 0.0]
    size[:n] = np.where(size[:n] > 0.0, size[:n], np.max(moving) if moving.size else 1.0)
    size[n : 2 * n] = np.maximum(size[n : 2 * n], omega * size[:n])
    size = np.where(size > 0.0, size, 1.0)
    # Size of a force: that which moves its joint by the size of the joint's motion within one radian.
    rates = (linear.transition[0] - np.eye(n_states)) / linear.dt
    for joint, (force, rate) in zip(rig.mechanism.joints, forces, strict=True):
        motion = joint_motion(equations.structure, joint)[0]
        by_state = [slope(motion, c.symbol) for c in rig.mechanism.free]
        slopes = equations.along(by_state, records[0], values, linear.reference)[:, 0]
        moved = float(np.sum(np.abs(slopes) * size[:n]))
        mobility = abs(float(slopes @ rates[n : 2 * n, force]))
        direct = seen[:, force]
        if mobility > 0.0:
            size[force] = moved * omega**2 / mobility
        elif np.any(direct > 0.0):
            size[force] = np.max(spreads[direct > 0.0] / direct[direct > 0.0])
        size[rate] = size[force] * omega
    return size


def _resting(joint: Joint, one: FollowedMotion, records: Sequence[Record]) -> Iterator[NDArray[np.bool_]]:
    """Yield, per record, the samples after which a joint may be at rest or reverses."""
    expression = joint_motion(one.equations.structure, joint)[1]
    velocities = [
        one.equations.along([expression], record, one.values, motion)[0]
        for record, motion in zip(records, one.motions, strict=True)
    ]
    usual = float(np.sqrt(np.mean(np.concatenate(velocities) ** 2)))
    for velocity in velocities:
        slow = np.abs(velocity) < _AT_REST * usual
        turns = np.append(velocity[1:] * velocity[:-1] < 0.0, False)
        # The force may change from the sample before the first slow one on.
        yield slow | turns | np.append(slow[1:], False)


def _found(
    joint: Joint,
    one: FollowedMotion,
    records: Sequence[Record],
    noise: Floats,
    by_parameter: Sequence[Floats],
) -> JointMotion:
    expressions = joint_motion(one.equations.structure, joint)
    moved = [
        one.equations.along(expressions, record, one.values, motion)
        for record, motion in zip(records, one.motions, strict=True)
    ]
    ((force, _),) = one.forces
    return JointMotion(
        joint=joint,
        followed=one,
        records=tuple(records),
        displacement=tuple(x for x, _ in moved),
        velocity=tuple(v for _, v in moved),
        force=tuple(motion[:, force] for motion in one.motions),
        error=tuple(error[:, force] for error in one.errors),
        by_parameter=tuple(by_parameter),
        remainder=one.remainder(records, noise),
    )
