"""The force at one joint alone with which a rig would follow its sensors, and the motion of that joint.

The rig has an unknown force at some of its joints, declared as an effect whose time history is a state. The equations are
linearized about the current estimate of the motion, a smoother improves the estimate, and this is repeated. First all joints have
an unknown force, so that the motion follows the sensors wherever the missing force acts. Then only one joint at a time has an
unknown force: the remaining sensor errors are evidence against this joint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.force_observer import Cases, Gains, cases_of, gains_of, smoothed, squares
from rigsight.discover.linearized_motion import LinearizedMotion, MotionEquations
from rigsight.effects import Effect, placed
from rigsight.effects.effect import Energy, GainTrend, Place, Signature, State
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig
from rigsight.simulate import Structure, compose, parameter_vector, record_input, rest_state
from rigsight.simulate.equations.binder import state_symbol
from rigsight.simulate.equations.derivatives import slope
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.simulation import record_values

_FORCE = sp.Symbol("missing_force", real=True)
_RATE = sp.Symbol("missing_force_rate", real=True)

_UNKNOWN_FORCE = Effect(
    name="missing_force",
    place=Place.DYNAMICS,
    summary="A force of unknown shape over time resists the motion.",
    parameters=(),
    energy=Energy.ACTIVE,
    signature=Signature(gain_trend=GainTrend.STEADY),
    torque=_FORCE,
    states=(State(_FORCE, _RATE, "force"), State(_RATE, sp.S.Zero, "force time^-1")),
)
"""An observer adds noise to the second derivative of the force; without it the force is a straight line over time."""


def _motion_of(structure: Structure, joint: Joint) -> tuple[sp.Expr, sp.Expr]:
    """Return the motion of a joint from its rest and its velocity, in the structure's symbols."""
    mechanism = structure.rig.mechanism
    bound: dict[sp.Symbol, sp.Expr] = {
        sp.Symbol(name, real=True): symbol
        for name, symbol in zip(structure.names, structure.parameter_symbols, strict=True)
    }
    for coordinate in mechanism.prescribed:
        value, rate, _ = input_symbols(mechanism.inputs.index(str(coordinate.prescribed_by)))
        bound |= {coordinate.symbol: value, coordinate.rate: rate}
    return (joint.motion - joint.rest).xreplace(bound), mechanism.rate(joint.motion).xreplace(bound)


_DECADES = (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0)
"""Intensities of an unknown force that are tried, in decades of its size and the motion's angular frequency."""
_BREADTH = 30.0
"""Standard deviation of the first state in units of its size: the estimate of a state that no sensor measures may be far off."""


_PASSES = 4
_SETTLED = 1e-2
"""Change of the motion, in units of its sizes, below which the linearization has converged."""
_AT_REST = 0.02
"""Share of a joint's RMS velocity below which it may stick: dry friction then has any value that holds the joint, and it jumps
when the motion reverses."""


@dataclass(eq=False)
class FollowedMotion:
    """A rig with an unknown force at some joints, and the current estimate of its motion."""

    equations: MotionEquations  # of the rig with the forces
    forces: tuple[tuple[int, int], ...]  # index of each force and of its rate among the states
    values: dict[str, float]  # constants and parameters
    motions: list[Floats]  # states per record, shape (n_samples, n_states) each
    sizes: Floats  # typical size of each state, shape (n_states,)
    omega: float  # angular frequency of the motion [rad/s]
    decade: float = 0.0  # common logarithm of the forces' intensity
    errors: list[Floats] = field(default_factory=list)  # standard errors of the states, as `motions`
    # Samples of each record after which the forces may jump, shape (n_samples,); None for none.
    jumps: list[NDArray[np.bool_] | None] = field(init=False)

    def __post_init__(self) -> None:
        """Let the forces jump nowhere."""
        self.jumps = [None] * len(self.motions)

    def linearized(self, records: Sequence[Record]) -> list[LinearizedMotion]:
        """Linearize about the current estimate of the motion in each record."""
        return [
            self.equations.about(record, self.values, motion)
            for record, motion in zip(records, self.motions, strict=True)
        ]

    def remainder(self, records: Sequence[Record], noise: Floats) -> float:
        """Return the weighted sum of squares of the sensor residuals of this motion."""
        return float(sum(np.nansum((m.residual / noise) ** 2) for m in self.linearized(records)))


def _with_unknown_forces(
    rig: Rig, effects: Sequence[Effect], joints: Sequence[str], fitted: Sequence[str]
) -> tuple[MotionEquations, tuple[tuple[int, int], ...]]:
    """Return the equations with effects and an unknown force at each of some joints, and the indices of these in the state."""
    forces = [placed(_UNKNOWN_FORCE, joint) for joint in joints]
    structure = compose(rig, [*effects, *forces])
    states = structure.states
    indices = [[states.index(state_symbol(own, part)) for part in (_FORCE, _RATE)] for own in forces]
    return MotionEquations(structure, fitted), tuple((force, rate) for force, rate in indices)


def _improved(
    followed: Sequence[FollowedMotion], records: Sequence[Record], noise: Floats, decades: Sequence[float]
) -> float:
    """Estimate motion and forces once more, for several rigs with the same number of states at once."""
    n_records = len(records)
    cases = _cases(followed, records, noise)
    tried = np.tile(np.asarray(decades), (len(followed), 1))
    gains = gains_of(cases, _intensities(followed, tried, n_records))
    costs = squares(cases, gains) + gains.log_variances
    for own, one, ranked in zip(tried, followed, costs.reshape(len(followed), n_records, -1), strict=True):
        known = np.nan_to_num(np.sum(ranked, axis=0), nan=np.inf)
        one.decade = float(own[int(np.argmin(known))])
    deviation, error = smoothed(cases, _likeliest(cases, followed, n_records), slice(0, 1))
    moved = 0.0
    for i, one in enumerate(followed):
        one.errors = []
        others = np.setdiff1d(np.arange(one.sizes.size), np.ravel(one.forces))
        for j, motion in enumerate(one.motions):
            step = deviation[: motion.shape[0], i * n_records + j, :, 0]
            one.motions[j] = motion + step * one.sizes
            one.errors.append(error[: motion.shape[0], i * n_records + j] * one.sizes)
            moved = max(moved, float(np.max(np.abs(step[:, others]))))
    return moved


def _force_by_parameter(
    followed: Sequence[FollowedMotion], records: Sequence[Record], noise: Floats
) -> list[list[Floats]]:
    """Return how much less force would be missing with more of each parameter, per rig and record.

    Shape (n_samples, n_parameters) each, for rigs with one unknown force: what a wrong value of a parameter adds to this force.
    """
    n_records = len(records)
    cases = _cases(followed, records, noise)
    ((force, _),) = followed[0].forces
    gains = _likeliest(cases, followed, n_records)
    changed, _ = smoothed(cases, gains, slice(1, None), slice(force, force + 1))
    return [
        [
            changed[: motion.shape[0], i * n_records + j, 0] * one.sizes[force]
            for j, motion in enumerate(one.motions)
        ]
        for i, one in enumerate(followed)
    ]


def _cases(followed: Sequence[FollowedMotion], records: Sequence[Record], noise: Floats) -> Cases:
    return cases_of(
        [motion for one in followed for motion in one.linearized(records)],
        noise,
        [one.sizes for one in followed for _ in records],
        followed[0].forces,
        _BREADTH,
        [own for one in followed for own in one.jumps],
    )


def _likeliest(cases: Cases, followed: Sequence[FollowedMotion], n_records: int) -> Gains:
    chosen = np.array([[one.decade] for one in followed])
    return gains_of(cases, _intensities(followed, chosen, n_records), keep=True)


def _intensities(followed: Sequence[FollowedMotion], decades: Floats, n_records: int) -> Floats:
    omega = np.array([[one.omega] for one in followed])
    return np.repeat(10.0**decades * omega, n_records, axis=0)


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


def _noise_of(rig: Rig, noise: Mapping[str, float]) -> Floats:
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
    floors = _noise_of(rig, noise)
    joints = rig.mechanism.joints
    every = _at_every_joint(rig, effects, records, dict(values), floors)
    n_own = every.sizes.size - 2 * len(joints)
    alone = []
    for index, joint in enumerate(joints):
        size = every.sizes[n_own + 2 * index : n_own + 2 * index + 2]
        equations, forces = _with_unknown_forces(rig, effects, [joint.name], fitted)
        columns = [*range(n_own), n_own + 2 * index, n_own + 2 * index + 1]
        motions = [motion[:, columns] for motion in every.motions]
        sizes = np.append(every.sizes[:n_own], size)
        alone.append(FollowedMotion(equations, forces, dict(values), motions, sizes, every.omega))
    _improved(alone, records, floors, _DECADES)
    # Estimated again about this motion; the force may jump where the joint rests.
    for joint, one in zip(joints, alone, strict=True):
        one.jumps = list(_resting(joint, one, records))
    _improved(alone, records, floors, _DECADES)
    nothing = [np.zeros((record.n_samples, 0)) for record in records]
    changes = _force_by_parameter(alone, records, floors) if fitted else [nothing for _ in joints]
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
    equations, forces = _with_unknown_forces(rig, effects, [joint.name for joint in joints], ())
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
    _improved([followed], records, noise, _DECADES)
    for _ in range(_PASSES):
        if _improved([followed], records, noise, (followed.decade,)) < _SETTLED:
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
        motion = _motion_of(equations.structure, joint)[0]
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
    expression = _motion_of(one.equations.structure, joint)[1]
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
    expressions = _motion_of(one.equations.structure, joint)
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
