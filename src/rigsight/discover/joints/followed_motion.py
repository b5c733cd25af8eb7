"""Motion of a rig that follows its sensors, and the forces at its joints that this requires.

The rig has an unknown force at some of its joints, declared as an effect whose time history is a state. The equations are
linearized about the current estimate of the motion, a smoother improves the estimate, and this is repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.joints.force_observer import Cases, Gains, cases_of, gains_of, smoothed, squares
from rigsight.discover.joints.linearized_motion import LinearizedMotion, MotionEquations
from rigsight.effects import Effect, placed
from rigsight.effects.effect import Energy, GainTrend, Place, Signature, State
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig
from rigsight.simulate import Structure, compose
from rigsight.simulate.equations.binder import state_symbol
from rigsight.simulate.equations.structure import input_symbols

_FORCE = sp.Symbol("missing_force", real=True)
_RATE = sp.Symbol("missing_force_rate", real=True)

UNKNOWN_FORCE = Effect(
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


def force_states(structure: Structure, effect: Effect) -> tuple[int, int]:
    """Return the indices of an unknown force and of its rate among the states of a structure."""
    force, rate = (structure.states.index(state_symbol(effect, symbol)) for symbol in (_FORCE, _RATE))
    return force, rate


def joint_motion(structure: Structure, joint: Joint) -> tuple[sp.Expr, sp.Expr]:
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


DECADES = (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0)
"""Intensities of an unknown force that are tried, in decades of its size and the motion's angular frequency."""
BREADTH = 30.0
"""Standard deviation of the first state in units of its size: the estimate of a state that no sensor measures may be far off."""


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


def with_unknown_forces(
    rig: Rig, effects: Sequence[Effect], joints: Sequence[str], fitted: Sequence[str]
) -> tuple[MotionEquations, tuple[tuple[int, int], ...]]:
    """Return the equations with effects and an unknown force at each of some joints, and the indices of these in the state."""
    forces = [placed(UNKNOWN_FORCE, joint) for joint in joints]
    structure = compose(rig, [*effects, *forces])
    return MotionEquations(structure, fitted), tuple(force_states(structure, force) for force in forces)


def improved(
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


def force_by_parameter(
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
        BREADTH,
        [own for one in followed for own in one.jumps],
    )


def _likeliest(cases: Cases, followed: Sequence[FollowedMotion], n_records: int) -> Gains:
    chosen = np.array([[one.decade] for one in followed])
    return gains_of(cases, _intensities(followed, chosen, n_records), keep=True)


def _intensities(followed: Sequence[FollowedMotion], decades: Floats, n_records: int) -> Floats:
    omega = np.array([[one.omega] for one in followed])
    return np.repeat(10.0**decades * omega, n_records, axis=0)
