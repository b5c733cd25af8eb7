"""Derivatives of the equations of a rig: sums of changes in symbols; numbers by states and inputs, and the equilibrium."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from scipy.optimize import least_squares

from rigsight.effects.symbols import derivative, positive_part
from rigsight.records.record import Floats
from rigsight.rigs import evaluated
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.kinks import absolute
from rigsight.simulate.equations.straight_line import StraightLine, in_order, of_parts, straight_line
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols

_NEAR = 1e-6
"""Distance from an equilibrium up to which a state counts as one, relative to each state or in SI units; the search for it stops
at 1e-8."""

_TINY = sp.Float(1e-300)
"""Added to a magnitude in a divisor or a logarithm: where the magnitude is zero, the finite result is multiplied by zero."""
_MODULES: list[Any] = [{positive_part.__name__: lambda x: max(x, 0.0)}, "numpy"]


@dataclass(frozen=True)
class _Motion:
    """The equations of motion, and the rates of the other states, as functions of states, inputs and parameters."""

    mass: Callable[..., Any]  # the mass matrix, shape (n, n)
    # Forces, then rates of the states other than the motion, and their derivatives by states and inputs,
    # shape (n_rows, n_by).
    balance: Callable[..., Any]
    changes: Callable[..., Floats]
    # Derivatives of the mass matrix times the accelerations, which are the last arguments, shape (n, n_by).
    turned: Callable[..., Floats]


class SlopeFunctions:
    """Compiled derivatives of a structure's equations; the mass matrix is inverted numerically (its symbolic inverse is long)."""

    def __init__(self, structure: Structure) -> None:
        self._n = len(structure.tree.motion.coordinates)
        self._n_states = len(structure.states)
        triples = [input_symbols(index) for index in range(len(structure.rig.mechanism.inputs))]
        self._n_inputs = len(triples)
        by = [*structure.states, *(triple[order] for order in range(3) for triple in triples)]
        arguments = [*by, *structure.parameter_symbols, TIME]
        self._output_slopes = _function(arguments, _jacobian(structure.outputs, by))
        self._motion = (
            _whole(structure, arguments, by)
            if structure.elimination is None
            else _in_parts(structure, structure.elimination, arguments, by)
        )

        # Indices of the states that are not velocities.
        self._held = np.concatenate([np.arange(self._n), np.arange(2 * self._n, self._n_states)])

    def _place(self, state: Floats, inputs: Floats, p: Floats) -> list[float]:
        return [*state, *inputs, *np.zeros(2 * self._n_inputs), *p, 0.0]

    def resting(self, near: Floats, inputs: Floats, p: Floats) -> Floats:
        """Return the equilibrium under constant inputs, or the state closest to it, from a nearby state."""
        state, held = near.copy(), self._held
        state[self._n : 2 * self._n] = 0.0
        if not held.size:
            return state

        def at(unknown: Floats) -> list[float]:
            state[held] = unknown
            return self._place(state, inputs, p)

        def balance(unknown: Floats) -> Floats:
            return np.asarray(self._motion.balance(*at(unknown)), dtype=np.float64)

        def slopes(unknown: Floats) -> Floats:
            return self._motion.changes(*at(unknown))[:, held]

        end = begin = state[held].copy()
        with np.errstate(all="ignore"):
            if np.all(np.isfinite(balance(begin))) and np.all(np.isfinite(slopes(begin))):
                found = least_squares(balance, begin, jac=slopes, x_scale="jac")
                end = found.x if found.success else begin
        state[held] = end
        return state

    def at(
        self, state: Floats, inputs: Floats, p: Floats
    ) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats], bool]:
        """Return the derivatives of the rates and of the outputs under constant inputs, and whether this is an equilibrium.

        Each by states, shape (n_rows, n_states), and by inputs and their first and second derivatives, (3, n_rows, n_inputs).
        """
        n, n_states, n_inputs = self._n, self._n_states, self._n_inputs
        place = self._place(state, inputs, p)
        slopes = np.zeros((n_states, n_states + 3 * n_inputs))
        with np.errstate(all="ignore"):
            balance = np.array(self._motion.balance(*place), dtype=np.float64)
            by_place = self._motion.changes(*place)
            outputs = self._output_slopes(*place)
            slopes[2 * n :] = by_place[n:]
            if n:
                mass = self._motion.mass(*place)
                accelerations = np.linalg.solve(mass, balance[:n])
                turned = self._motion.turned(*place, *accelerations)
                slopes[np.arange(n), n + np.arange(n)] = 1.0
                slopes[n : 2 * n] = np.linalg.solve(mass, by_place[:n] - turned)
        held = self._held
        near = np.abs(by_place[:, held]) @ (_NEAR * np.maximum(np.abs(state[held]), 1.0))

        def divided(rows: Floats) -> tuple[Floats, Floats]:
            by_inputs = rows[:, n_states:].reshape(rows.shape[0], 3, n_inputs)
            return rows[:, :n_states], np.moveaxis(by_inputs, 1, 0)

        return divided(slopes), divided(outputs), bool(np.all(np.abs(balance) <= near))


slope_functions = lru_cache(maxsize=128)(SlopeFunctions)
"""The same of a structure, made once."""


def declared_start(structure: Structure, p: Floats) -> Floats:
    """Return the start values declared in the rig file, shape (n_states,); zero for states without one."""
    states, values = structure.states, dict(zip(structure.names, p, strict=True))
    found = {s: evaluated(own, values) for s, own in structure.rig.mechanism.initial.items() if s in states}
    return np.array([found.get(state, 0.0) for state in states])


def _whole(structure: Structure, arguments: Sequence[sp.Symbol], by: Sequence[sp.Symbol]) -> _Motion:
    """Return the functions of equations that are differentiated as whole expressions."""
    tree, motion = structure.tree, structure.tree.motion
    mass = motion.mass.applyfunc(tree.flattened)
    forces = [tree.flattened(force) for force in motion.forces]
    rates = [tree.flattened(state.rate) for state in tree.states]
    of_forces, of_rates = (_function(arguments, _jacobian(own, by)) for own in (forces, rates))
    of_mass = _function(arguments, [derivative(mass, symbol) for symbol in by])
    n = len(forces)

    def turned(*place: float) -> Floats:
        accelerations = np.array(place[len(place) - n :])
        slopes = of_mass(*place[: len(place) - n])
        return np.column_stack([slope @ accelerations for slope in slopes])

    return _Motion(
        mass=_function(arguments, mass),
        balance=_function(arguments, [*forces, *rates]),
        changes=lambda *place: np.vstack([of_forces(*place), of_rates(*place)]),
        turned=turned,
    )


def _in_parts(
    structure: Structure, elimination: Elimination, arguments: Sequence[sp.Symbol], by: Sequence[sp.Symbol]
) -> _Motion:
    """Return the functions of equations that are differentiated part by part."""
    n, begun = elimination.size, elimination.begun(structure.steps)
    rates = [structure.tree.flattened(state.rate) for state in structure.tree.states]
    balance = straight_line([*elimination.loads, *rates], begun)
    inertial = straight_line([sp.Add(*(m * a for m, a in elimination.moved(i))) for i in range(n)], begun)
    mass = straight_line(elimination.entries, begun).function(arguments, _MODULES)
    changes = slopes_of(balance, by).function(arguments, _MODULES)
    turned = slopes_of(inertial, by).function([*arguments, *elimination.accelerations], _MODULES)
    return _Motion(
        mass=lambda *place: np.reshape(mass(*place), (n, n)),
        balance=balance.function(arguments, _MODULES),
        changes=lambda *place: np.reshape(changes(*place), (-1, len(by))),
        turned=lambda *place: np.reshape(turned(*place), (n, len(by))),
    )


def _jacobian(expressions: Sequence[sp.Expr], by: Sequence[sp.Symbol]) -> sp.Matrix:
    return sp.Matrix(
        len(expressions),
        len(by),
        [derivative(expression, symbol) for expression in expressions for symbol in by],
    )


def _function(arguments: Sequence[sp.Symbol], expressions: Any) -> Callable[..., Any]:
    return sp.lambdify(arguments, expressions, _MODULES, cse=True)  # type: ignore[no-any-return]


def slopes_of(line: StraightLine, by: Sequence[sp.Symbol]) -> StraightLine:
    """Return the derivatives of each expression, evaluated in parts, with respect to each of some arguments."""
    own = {key: _own_slopes(expression, {*line.parts, *by}) for key, expression in line.parts.items()}
    shown = [_own_slopes(result, {*line.parts, *by}) for result in line.results]
    parts, columns = dict(line.parts), []
    for symbol in by:
        changes: dict[sp.Symbol, sp.Expr] = {symbol: sp.S.One}
        for part, slopes in own.items():
            change = _joined(slopes, changes)
            if change == 0:
                continue
            if not change.is_Atom:
                name = sp.Symbol(f"slope {len(parts)}", real=True)
                parts[name], change = change, name
            changes[part] = change
        columns.append([_joined(slopes, changes) for slopes in shown])
    return of_parts(parts, tuple(change for row in zip(*columns, strict=True) for change in row))


def _own_slopes(expression: sp.Expr, symbols: set[sp.Symbol]) -> list[tuple[sp.Symbol, sp.Expr]]:
    return [(s, slope(expression, s)) for s in in_order(expression.free_symbols & symbols)]


def _joined(slopes: Sequence[tuple[sp.Symbol, sp.Expr]], changes: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    return sp.Add(*(factor * changes[symbol] for symbol, factor in slopes if symbol in changes))


@dataclass(frozen=True)
class LinearForms:
    """Changes of expressions as sums of products."""

    # Symbol -> the derivative that it denotes; they are the same for all changes.
    factors: Mapping[sp.Symbol, sp.Expr]
    sums: tuple[sp.Expr, ...]  # change of each expression, in terms of factors, constants, changes and steps
    # Of expressions that contain accelerations: symbols in the factors -> their expressions, in any order; and symbols in the
    # sums -> theirs in factors, constants and changes, which are the changes of the accelerations.
    parts: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    steps: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)


def linear_forms(
    expressions: Sequence[sp.Expr], changes: Mapping[sp.Symbol, sp.Expr], constants: set[sp.Symbol]
) -> LinearForms:
    """Return the changes of expressions due to changes of their symbols, with all signs held constant."""
    factors: dict[sp.Expr, sp.Symbol] = {}

    def factor(derivative: sp.Expr) -> sp.Expr:
        if derivative.is_number or derivative in constants:
            return derivative
        return factors.setdefault(derivative, sp.Symbol(f"factor {len(factors)}", real=True))

    sums = []
    for expression in expressions:
        own = [s for s in changes if s in expression.free_symbols]
        terms = [factor(slope(expression, symbol)) * changes[symbol] for symbol in own]
        sums.append(sp.Add(*terms))
    return LinearForms({symbol: derivative for derivative, symbol in factors.items()}, tuple(sums))


@lru_cache(maxsize=16_384)
def slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    """Return a derivative that is finite where a magnitude is zero; the derivative of a sign is taken as zero."""
    # Term by term, because sympy takes as long for a derivative that is zero as for another one.
    terms = [term for term in sp.Add.make_args(expression) if symbol in term.free_symbols]
    total = sp.Add(*(_of_term(term, symbol) for term in terms))
    if total.is_Atom:
        return total
    return total.replace(_is_singular, _guarded)


def _of_term(term: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    if term == symbol:
        return sp.S.One
    if term.is_Mul and symbol in term.args:
        others = [factor for factor in term.args if factor != symbol]
        if not any(symbol in factor.free_symbols for factor in others):
            # Most parts of long expressions have this form, for which sympy takes ten times as long.
            return sp.Mul(*others)
    return derivative(term, symbol)


def _is_singular(part: sp.Expr) -> bool:
    if isinstance(part, sp.log):
        return isinstance(part.args[0], (sp.Abs, absolute))
    if not (part.is_Pow and isinstance(part.base, (sp.Abs, absolute))):
        return False
    return bool(part.exp.as_coeff_Add()[0] < 0)


def _guarded(part: sp.Expr) -> sp.Expr:
    if isinstance(part, sp.log):
        return sp.log(part.args[0] + _TINY)
    whole = part.exp + 1
    # The power itself is computed anyway: another logarithm and exponential would cost as much as all other operations.
    return part.base**whole / (part.base + _TINY) if whole.free_symbols else (part.base + _TINY) ** part.exp
