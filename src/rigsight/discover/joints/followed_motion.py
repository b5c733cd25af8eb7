"""Motion of a rig that follows its sensors, and the forces at its joints that this requires.

The rig has an unknown force at some of its joints, declared as an effect whose time history is a state. The equations are
linearized about the current estimate of the motion, a smoother improves the estimate, and this is repeated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.discover.joints.force_observer import Cases, Gains, cases_of, gains_of, smoothed, whitened
from rigsight.discover.joints.linearized_motion import LinearizedMotion, MotionEquations
from rigsight.effects import Effect, placed
from rigsight.effects.effect import Energy, GainTrend, Place, Signature, State
from rigsight.parameters import Parameter
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
_KNOWN = 0.5
"""Relative standard deviation of a parameter that was identified without the force. Without this prior, a parameter that the
sensors do not distinguish from the force (the inertia of the joint on which it acts) would diverge."""
_FACTOR = 2.0
"""Largest factor by which one linearized estimate may change a parameter."""
_FACTOR_IN_ALL = 4.0
"""Largest factor by which a parameter may differ from its prior value; a force at the wrong joint could distort it further."""


@dataclass(eq=False)
class FollowedMotion:
    """A rig with an unknown force at some joints, and the current estimate of its motion."""

    equations: MotionEquations  # of the rig with the forces
    forces: tuple[tuple[int, int], ...]  # index of each force and of its rate among the states
    fitted: tuple[Parameter, ...]  # parameters with respect to which the equations have derivatives
    values: dict[str, float]  # constants and parameters
    motions: list[Floats]  # states per record, shape (n_samples, n_states) each
    sizes: Floats  # typical size of each state, shape (n_states,)
    omega: float  # angular frequency of the motion [rad/s]
    decade: float = 0.0  # common logarithm of the forces' intensity
    errors: list[Floats] = field(default_factory=list)  # standard errors of the states, as `motions`
    known: dict[str, float] = field(init=False)  # prior values of constants and parameters
    # Samples of each record after which the forces may jump, shape (n_samples,); None for none.
    jumps: list[NDArray[np.bool_] | None] = field(init=False)

    def __post_init__(self) -> None:
        """Keep the prior values; they hold an estimate that the records do not determine."""
        self.known = dict(self.values)
        self.jumps = [None] * len(self.motions)

    @property
    def offsets(self) -> Floats:
        """Differences of the fitted parameters from their prior values, shape (n_fitted,)."""
        return np.array([self.values[p.name] - self.known[p.name] for p in self.fitted])

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
    rig: Rig, joints: Sequence[str], fitted: Sequence[Parameter]
) -> tuple[MotionEquations, tuple[tuple[int, int], ...]]:
    """Return the equations of a rig with an unknown force at each of some joints, and the indices of the forces in the state."""
    effects = [placed(UNKNOWN_FORCE, joint) for joint in joints]
    structure = compose(rig, effects)
    equations = MotionEquations(structure, [p.name for p in fitted])
    return equations, tuple(force_states(structure, effect) for effect in effects)


def improved(
    followed: Sequence[FollowedMotion], records: Sequence[Record], noise: Floats, decades: Sequence[float]
) -> float:
    """Estimate motion and forces once more, for several rigs with the same number of states at once."""
    n_records = len(records)
    linear = [motion for one in followed for motion in one.linearized(records)]
    cases = cases_of(
        linear,
        noise,
        [one.sizes for one in followed for _ in records],
        followed[0].forces,
        BREADTH,
        [own for one in followed for own in one.jumps],
        lasting=True,
    )
    tried = np.tile(np.asarray(decades), (len(followed), 1))
    gains = gains_of(cases, _intensities(followed, tried, n_records))
    costs = _squares(cases, gains) + gains.log_variances
    for own, one, ranked in zip(tried, followed, costs.reshape(len(followed), n_records, -1), strict=True):
        known = np.nan_to_num(np.sum(ranked, axis=0), nan=np.inf)
        one.decade = float(own[int(np.argmin(known))])
    chosen = np.array([[one.decade] for one in followed])
    gains = gains_of(cases, _intensities(followed, chosen, n_records), keep=True)
    deviation, error = smoothed(cases, gains, cases.drive[..., 0], cases.data[..., 0])
    moved = 0.0
    for i, one in enumerate(followed):
        one.errors = []
        others = np.setdiff1d(np.arange(one.sizes.size), np.ravel(one.forces))
        for j, motion in enumerate(one.motions):
            step = deviation[: motion.shape[0], i * n_records + j]
            one.motions[j] = motion + step * one.sizes
            one.errors.append(error[: motion.shape[0], i * n_records + j] * one.sizes)
            moved = max(moved, float(np.max(np.abs(step[:, others]))))
    return moved


def _intensities(followed: Sequence[FollowedMotion], decades: Floats, n_records: int) -> Floats:
    omega = np.array([[one.omega] for one in followed])
    return np.repeat(10.0**decades * omega, n_records, axis=0)


def _squares(cases: Cases, gains: Gains) -> Floats:
    """Return the sum of squares of the filter's whitened prediction errors, shape (n_cases, n_intensities)."""
    total = np.zeros(gains.variance.shape[1:3])

    def tell(_sample: int, _sensor: int, rows: Floats) -> None:
        nonlocal total
        total += rows[..., 0] ** 2

    whitened(cases, gains, lambda k: cases.drive[k, :, :, :1], lambda k: cases.data[k, :, :, :1], tell)
    return total


def prior_spread(one: FollowedMotion, target: float, own: Floats) -> Floats:
    """Return the prior standard deviations of the parameters, shape (n_fitted,)."""
    known = np.array([one.known[p.name] for p in one.fitted])
    reach = np.sqrt(target / np.where(own > 0.0, own, 1.0))
    return np.where(known != 0.0, _KNOWN * np.abs(known), reach)


def within_reach(one: FollowedMotion, found: Mapping[str, float]) -> dict[str, float]:
    """Return the estimates of the parameters, limited to their bounds and to the range in which the linearization is trusted."""
    values = dict(one.values)
    for parameter in one.fitted:
        value = values[parameter.name]
        low, high = parameter.lower, parameter.upper
        for origin, factor in ((value, _FACTOR), (one.known[parameter.name], _FACTOR_IN_ALL)):
            if origin > 0.0 and parameter.lower >= 0.0:
                low, high = max(low, origin / factor), min(high, origin * factor)
            elif origin != 0.0:
                low, high = max(low, origin - factor * abs(origin)), min(high, origin + factor * abs(origin))
        values[parameter.name] = float(np.clip(found[parameter.name], low, high))
    return values
