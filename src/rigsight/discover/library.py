"""Library of terms that the equation may contain, evaluated along the measured motion.

Every candidate comes from the declaration of an effect. Parameters in which the torque is linear become coefficients; nonlinear
ones (a clearance, a dead time, the shape of a loop) are estimated by variable projection: a grid over them, linear regression for
the rest. Each effect then contributes one column to the library, at its best nonlinear parameters.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import sympy as sp
from scipy.signal import cont2discrete, lfilter, ss2tf

from rigsight.discover.hysteresis import best_loop, is_loop
from rigsight.discover.monomials import MONOMIALS
from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected, Regressed, alike
from rigsight.effects import CATALOGUE, Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.effect import Place
from rigsight.effects.symbols import derivative
from rigsight.parameters import Parameter
from rigsight.records.record import Floats
from rigsight.rigs import Rig
from rigsight.units import characteristic_value

_SIGNALS = (canonical.x, canonical.v, canonical.u)
"""Signals of a motion that are known at every sample."""
Filter = tuple[sp.Matrix, sp.Matrix]
"""Rates per unit of each state, and per unit of each signal."""


_GRID = 10
_SAME_COLUMN = 0.999
_LEAST_SHARE = 0.02
_MOST_SHARE = 3.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect at its best nonlinear parameters, as one column of the library."""

    effect: Effect
    inner: Mapping[str, float]  # values of the nonlinear parameters inside the term
    # Share of each of the effect's linear parameters in the coefficient of the column; empty if it has none.
    linear: Mapping[str, float]
    column: Floats  # rows of all records, shape (n_rows,)

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name


def offered_effects(rig: Rig, has_stiffness: bool) -> list[Effect]:
    """Return the effects that can be terms of a regression on this rig.

    Effects with states are left out, because a state is not measured, except loops and filters of the drive, whose states
    follow from motion and input. A torque that depends on states is left out in any case: an attached mass would explain the
    acceleration by the acceleration.
    """
    changes_spring = [e for e in (*CATALOGUE, *MONOMIALS) if e.spring is not None or e.deflection is not None]
    return [
        effect
        for effect in (*CATALOGUE, *MONOMIALS)
        if rig.offers(effect)
        and (has_stiffness or effect not in changes_spring)
        and (is_loop(effect) or _filters_drive(effect) or _is_static(effect))
    ]


def _is_static(effect: Effect) -> bool:
    """Return True for a known function of displacement, velocity and input, without states or other torques."""
    known = (effect.torque, effect.deflection, effect.drive, effect.delay)
    symbols = {
        canonical.x,
        canonical.v,
        canonical.u,
        *(sp.Symbol(p.name, real=True) for p in effect.parameters),
    }
    return (
        effect.place in (Place.ACTUATOR, Place.DYNAMICS)
        and not effect.states
        and effect.spring is None
        and any(part is not None for part in known)
        and all(part is None or part.free_symbols <= symbols for part in known)
    )


def _filters_drive(effect: Effect) -> bool:
    """Return True for a drive that follows the input through states of its own."""
    return effect.place is Place.ACTUATOR and effect.drive is not None and is_filter(effect)


def candidates(effects: Sequence[Effect], regressed: Regressed) -> list[Candidate]:
    """Return one candidate per effect, at the nonlinear parameters that explain most of the residual of the rig's own terms."""

    def at_best_values(effect: Effect) -> Candidate | None:
        if not is_loop(effect):
            return _best_inner(effect, regressed)
        loop = best_loop(effect, regressed)
        return None if loop is None else Candidate(effect, loop.values, {}, loop.column)

    # Of terms that the records do not distinguish the first one counts: a torque with one coefficient comes before others.
    ordered = sorted(effects, key=lambda effect: not _is_plain(effect))
    fitted = regressed.threads.side_by_side(at_best_values, ordered)
    return [best for best in fitted if best is not None]


def _best_inner(effect: Effect, regressed: Regressed) -> Candidate | None:
    best: Candidate | None = None
    highest = 0.0
    for signals in term_signals(effect, regressed.motions, regressed.scales):
        parts = np.column_stack([regressed.column(part) for part in zip(*signals.parts, strict=True)])
        candidate, share = mixed(signals, parts, regressed.projected)
        if share > highest:
            best, highest = candidate, share
    return best


def distinct(
    library: Sequence[Candidate], projected: Projected
) -> tuple[list[Candidate], dict[str, list[str]]]:
    """Leave out terms that these records do not distinguish from an earlier one; return the rest, and the terms each replaces."""
    if not library:
        return [], {}
    columns = np.column_stack([candidate.column for candidate in library])
    stands_for: dict[str, list[str]] = {}
    dropped: set[int] = set()
    for i, j, _ in alike(projected, columns, _SAME_COLUMN):
        # A loop may degenerate to friction or damping, but not vice versa: the simpler term represents it.
        loops = [is_loop(library[k].effect) for k in (i, j)]
        first, second = (j, i) if loops == [True, False] else (i, j)
        if first not in dropped and second not in dropped:
            dropped.add(second)
            stands_for.setdefault(library[first].name, []).append(library[second].name)
    return [candidate for i, candidate in enumerate(library) if i not in dropped], stands_for


def mixed(signals: TermSignals, parts: Floats, projected: Projected) -> tuple[Candidate, float]:
    """Return the parts of a term as one column, mixed as in the regression, and the share that it explains."""
    weights, share = projected.explained(parts)
    if not np.any(weights):
        return Candidate(signals.effect, signals.inner, {}, parts[:, 0]), 0.0
    # One part keeps its own unit.
    mixture = np.ones(1) if len(weights) == 1 else weights / np.max(np.abs(weights))
    linear = dict(zip(signals.names, map(float, mixture), strict=True)) if signals.names else {}
    return Candidate(signals.effect, signals.inner, linear, parts @ mixture), share


def _is_plain(effect: Effect) -> bool:
    """Return True for a torque with one coefficient and no other parameter."""
    return effect.torque is not None and not effect.states and len(effect.parameters) == 1


def _slope(effect: Effect, parameter: Parameter) -> sp.Expr:
    assert effect.torque is not None
    return derivative(effect.torque, sp.Symbol(parameter.name, real=True))


@dataclass(frozen=True, eq=False)
class TermSignals:
    """An effect along measured motions, for given nonlinear parameters."""

    effect: Effect
    inner: Mapping[str, float]  # values of the nonlinear parameters inside the term
    # Linear parameters, one for each part; empty if the term has a single part without a coefficient of its own.
    names: tuple[str, ...]
    # For each record, the parts as resisting forces per unit of their coefficient, shape (n_samples,) each.
    parts: tuple[tuple[Floats, ...], ...]


def term_signals(
    effect: Effect, motions: Sequence[Motion], scales: Mapping[str, float]
) -> Iterator[TermSignals]:
    """Yield an effect along measured motions, for each point of the grid of its nonlinear parameters."""
    fitted = [p for p in effect.parameters if p.fitted]
    linear = effect.linear_parameters
    inside = [p for p in fitted if p not in linear]
    names = tuple(p.name for p in linear)
    held = {
        p.name: p.held_at(characteristic_value(p.dimension, scales))
        for p in effect.parameters
        if not p.fitted
    }
    for values in itertools.product(*(_grid(p, scales) for p in inside)):
        inner = {**held, **dict(zip((p.name for p in inside), values, strict=True))}
        parts = tuple(tuple(_signals(effect, linear, inner, motion)) for motion in motions)
        yield TermSignals(effect, inner, names, parts)


def _grid(parameter: Parameter, scales: Mapping[str, float]) -> list[float]:
    size = characteristic_value(parameter.dimension, scales)
    low, high = max(parameter.search[0], _LEAST_SHARE), min(parameter.search[1], _MOST_SHARE)
    return [float(share * size) for share in np.geomspace(low, 0.97 * high, _GRID)]


def _signals(
    effect: Effect, linear: Sequence[Parameter], inner: Mapping[str, float], motion: Motion
) -> list[Floats]:
    """Return the parts of an effect as resisting forces per unit of their coefficient."""
    if effect.delay is not None:
        time = motion.dt * np.arange(motion.u.size)
        return [motion.u - np.interp(time - along(effect.delay, inner, motion), time, motion.u)]
    if effect.torque is not None:
        return [along(_slope(effect, p), inner, motion) for p in linear]
    if effect.deflection is not None:
        return [along(effect.deflection, inner, motion) - motion.x]
    assert effect.drive is not None
    defaults = {p.name: p.default for p in effect.parameters if p.default is not None}
    states = states_along(effect, {**defaults, **inner}, motion) if effect.states else {}
    return [motion.u - along(effect.drive, {**inner, **states}, motion)]


def along(expression: sp.Expr | None, values: Mapping[str, float | Floats], motion: Motion) -> Floats:
    """Return a static part of an effect (torque, deflection) along a measured motion, shape (n_samples,)."""
    assert expression is not None
    function = _compiled(expression, tuple(values))
    shown = function(motion.x, motion.v, motion.u, *values.values())
    return np.broadcast_to(shown, motion.x.shape).astype(np.float64)


@lru_cache(maxsize=256)
def _compiled(expression: sp.Expr, names: tuple[str, ...]) -> Any:
    """Return an expression as a function of displacement, velocity, input and named parameters."""
    plain = expression.replace(canonical.positive_part, lambda e: (e + sp.Abs(e)) / 2)
    own = [sp.Symbol(name, real=True) for name in names]
    return sp.lambdify((canonical.x, canonical.v, canonical.u, *own), plain, "numpy", cse=True)


@lru_cache(maxsize=256)
def linear_filter(effect_states: tuple[tuple[sp.Symbol, sp.Expr], ...]) -> Filter | None:
    """Return the linear filter that these rates describe; None if they are not linear."""
    own = [symbol for symbol, _ in effect_states]
    rates = sp.Matrix([rate for _, rate in effect_states])
    of_states, of_signals = rates.jacobian(own), rates.jacobian(_SIGNALS)
    remainder = (rates - of_states * sp.Matrix(own) - of_signals * sp.Matrix(_SIGNALS)).applyfunc(sp.simplify)
    varying = (of_states.free_symbols | of_signals.free_symbols) & {*own, *_SIGNALS, canonical.t}
    return None if varying or any(remainder) else (of_states, of_signals)


def is_filter(effect: Effect) -> bool:
    """Return True if an effect's states depend linearly on displacement, velocity and input, and have no limit."""
    if not effect.states or any(state.limit is not None for state in effect.states):
        return False
    own = {state.symbol for state in effect.states}
    parameters = {sp.Symbol(p.name, real=True) for p in effect.parameters}
    known = own | parameters | set(_SIGNALS)
    if not all(state.rate.free_symbols <= known for state in effect.states):
        return False
    return linear_filter(_rates(effect)) is not None


def states_along(effect: Effect, values: Mapping[str, float], motion: Motion) -> dict[str, Floats]:
    """Return the states of a filter along a motion by name, shape (n_samples,) each.

    They start in equilibrium with the first sample of each signal.
    """
    found = linear_filter(_rates(effect))
    assert found is not None
    numbers = {sp.Symbol(name, real=True): value for name, value in values.items()}
    rates, drive = (np.array(part.subs(numbers), dtype=np.float64) for part in found)
    n = len(effect.states)
    states = np.zeros((motion.x.size, n))
    for column, signal in enumerate((motion.x, motion.v, motion.u)):
        if not np.any(drive[:, column]):
            continue
        held: Literal["zoh", "foh"] = "zoh" if signal is motion.u and motion.record.hold == "zoh" else "foh"
        system = rates, drive[:, [column]], np.eye(n), np.zeros((n, 1))
        numerators, denominator = ss2tf(*cont2discrete(system, motion.dt, method=held)[:4])
        at_rest = np.linalg.solve(rates, -drive[:, column]) * signal[0]
        moved = [lfilter(numerator, denominator, signal - signal[0]) for numerator in numerators]
        states += at_rest + np.column_stack(moved)
    return {state.symbol.name: states[:, i] for i, state in enumerate(effect.states)}


def _rates(effect: Effect) -> tuple[tuple[sp.Symbol, sp.Expr], ...]:
    return tuple((state.symbol, state.rate) for state in effect.states)
