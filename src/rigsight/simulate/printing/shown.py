"""Displayed equations: those of the tree in display order, in any language."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp
from sympy.printing.precedence import PRECEDENCE

from rigsight.effects.symbols import positive_part
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.equations.tree import late
from rigsight.simulate.printing.names import (
    ShownName,
    declared_name,
    in_words,
    kinematic_states,
    output_symbol,
    rate_symbol,
    shown_names,
    simulated_symbol,
)
from rigsight.simulators import place_of, simulated

_MIN, _MAX, _CLIP = map(sp.Function, ("min", "max", "clip"))
"""The displayed functions: `min` and `max` of two values, `clip` of a value and the ends of its range."""


class moved(sp.Function):  # type: ignore[misc]  # noqa: N801
    """A mass and the acceleration by which it is multiplied, in this order."""

    is_real = True


@dataclass(frozen=True)
class ShownEquation:
    """``left = sum of terms``."""

    owner: str | None  # name of the effect to which it belongs; None for the rig
    left: sp.Expr  # a symbol, or masses times accelerations
    terms: tuple[sp.Expr, ...]  # terms of the right-hand side, in display order
    # A state and the half-width of the range that it cannot leave.
    limit: tuple[sp.Symbol, sp.Expr] | None = None
    # The masses with their accelerations whose sum is `left`, in display order.
    inertia: tuple[tuple[sp.Expr, sp.Symbol], ...] = ()

    @property
    def signed_terms(self) -> tuple[tuple[str, sp.Expr], ...]:
        """The terms, each with its sign: ``+``, ``-``, or empty for a positive first term."""
        if len(self.terms) == 1:
            return (("", self.terms[0]),)
        return _signed(part for term in self.terms for part in sp.Add.make_args(term))

    def mapped(self, change: Callable[[sp.Expr], sp.Expr]) -> ShownEquation:
        """Return the equation with changed expressions."""
        return replace(
            self,
            left=change(self.left),
            terms=tuple(map(change, self.terms)),
            limit=None if self.limit is None else (self.limit[0], change(self.limit[1])),
            inertia=tuple((change(mass), rate) for mass, rate in self.inertia),
        )

    def written(
        self, expression: Callable[[sp.Expr], str], joined: Mapping[str, str], within: str
    ) -> tuple[str, str]:
        """Return both sides in a language."""

        def summed(signed: Iterable[tuple[str, sp.Expr]]) -> str:
            return "".join(joined[sign] + expression(term) for sign, term in signed)

        signs = _signed(mass for mass, _ in self.inertia)
        left = [
            (sign, mass * rate if mass.is_Atom else moved(mass, rate))
            for (sign, mass), (_, rate) in zip(signs, self.inertia, strict=True)
        ]
        right = summed(self.signed_terms)
        if self.limit is not None:
            state, half_width = self.limit
            right += within % (expression(state), expression(half_width))
        return summed(left) if left else expression(self.left), right


def _signed(parts: Iterable[sp.Expr]) -> tuple[tuple[str, sp.Expr], ...]:
    signed: list[tuple[str, sp.Expr]] = []
    for part in parts:
        negative = part.as_coeff_Mul()[0].is_negative
        plus = "+" if signed else ""
        signed.append(("-", -part) if negative else (plus, part))
    return tuple(signed)


@dataclass(frozen=True)
class ShownEquations:
    """The equations of a structure with the names of their symbols."""

    names: Mapping[sp.Symbol, ShownName]  # name of each symbol
    # The equations; those of one owner follow each other, the rig's come first.
    equations: tuple[ShownEquation, ...]

    @property
    def of_owners(self) -> dict[str | None, tuple[ShownEquation, ...]]:
        """The equations of the rig (key None), then those of each effect by its name, in the order of the signal path."""
        owners = dict.fromkeys(equation.owner for equation in self.equations)
        return {owner: tuple(e for e in self.equations if e.owner == owner) for owner in owners}


def shown_equations(structure: Structure, label: Callable[[str], str] = in_words) -> ShownEquations:
    """Return the equations of a structure in the form in which they are displayed."""
    tree = structure.tree
    names = shown_names(structure, label)
    effects = [
        ShownEquation(d.owner, d.symbol, (d.expression,)) for d in tree.definitions if d.rate_of is None
    ]
    motion = _motion(structure) if structure.elimination is None else _motion_in_parts(structure)
    every = [*motion, *effects, *_states(structure), *_outputs(structure, names)]
    every = [e.mapped(_by_name) for e in every]
    every = [replace(e, terms=tuple(map(with_limits, e.terms))) for e in every]
    owners = dict.fromkeys([None, *(equation.owner for equation in every)])
    return ShownEquations(names, tuple(e for owner in owners for e in every if e.owner == owner))


def flat_equations(structure: Structure, numbers: Mapping[sp.Symbol, sp.Expr]) -> ShownEquations:
    """Return the equations of a structure without definitions, one for each degree of freedom, state and output."""
    tree = structure.tree
    values: dict[sp.Symbol, sp.Expr] = {}
    for definition in tree.definitions:
        value = definition.expression
        if isinstance(value, late):
            value = late(*tree.lateness(definition.symbol))
        values[definition.symbol] = value.xreplace(values)

    names = shown_names(structure)

    def flat(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace(values).xreplace(numbers)

    motion = (equation.mapped(_by_name) for equation in _motion(structure))
    every = [own.mapped(flat) for own in (*motion, *_states(structure), *_outputs(structure, names))]
    present = ([term for term in equation.terms if term != 0] for equation in every)
    shown = (replace(e, terms=tuple(terms) or (sp.S.Zero,)) for e, terms in zip(every, present, strict=True))
    return ShownEquations(names, tuple(shown))


def _by_name(expression: sp.Expr) -> sp.Expr:
    """Return an expression with names for quantities from another simulator, because their formulas are unknown."""
    leaves = expression.atoms(simulated)
    return expression.xreplace({leaf: simulated_symbol(place_of(leaf)) for leaf in leaves})


def _motion(structure: Structure) -> list[ShownEquation]:
    motion = structure.tree.motion
    accelerations = [rate_symbol(velocity) for velocity in motion.velocities]
    equations = []
    for row, terms in zip(motion.mass.tolist() if accelerations else (), motion.terms, strict=True):
        inertia = tuple((mass, rate) for mass, rate in zip(row, accelerations, strict=True) if mass != 0)
        left = sp.Add(*(mass * rate for mass, rate in inertia))
        equations.append(ShownEquation(None, left, terms or (sp.S.Zero,), inertia=inertia))
    return equations


def _motion_in_parts(structure: Structure) -> list[ShownEquation]:
    """Return the equations of motion with names for long masses and forces, followed by the equations of these."""
    motion, elimination = structure.tree.motion, structure.elimination
    assert elimination is not None
    rates = dict(zip(elimination.accelerations, map(rate_symbol, motion.velocities), strict=True))
    equations = []
    for row, load in enumerate(elimination.loads):
        inertia = tuple((mass, rates[a]) for mass, a in elimination.moved(row))
        left = sp.Add(*(mass * rate for mass, rate in inertia))
        equations.append(ShownEquation(None, left, (load,), inertia=inertia))
    masses = [ShownEquation(None, mass, (motion.mass[at],)) for at, mass in elimination.mass.items()]
    loads = zip(elimination.loads, motion.terms, strict=True)
    return [*equations, *masses, *(ShownEquation(None, load, terms or (sp.S.Zero,)) for load, terms in loads)]


def _states(structure: Structure) -> list[ShownEquation]:
    kinematic = kinematic_states(structure)
    shown = [state for state in structure.tree.states if state.symbol not in kinematic]
    rates = [rate_symbol(kinematic.get(state.symbol, state.symbol)) for state in shown]
    limits = [None if state.limit is None else (state.symbol, state.limit) for state in shown]
    return [
        ShownEquation(s.owner, rate, s.terms, limit)
        for s, rate, limit in zip(shown, rates, limits, strict=True)
    ]


def _outputs(structure: Structure, names: Mapping[sp.Symbol, ShownName]) -> list[ShownEquation]:
    """Return the equations of the outputs, except those whose expression already has the name of the output."""
    return [
        ShownEquation(None, output_symbol(output.name), output.terms)
        for output in structure.tree.outputs
        if names.get(sp.Add(*output.terms)) != declared_name(output.name)
    ]


def with_limits(expression: sp.Expr) -> sp.Expr:
    """Return an expression with its limits as named functions."""
    if not expression.has(positive_part):
        return expression
    if expression.is_Add:
        for found in (_clamped(expression), _smaller(expression), _larger(expression)):
            if found is not None:
                return found
    return expression.func(*map(with_limits, expression.args))


def _clamped(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``x - positive_part(x - high) + positive_part(low - x)``."""
    for down in _parts(total, -1):
        for up in _parts(total, 1):
            x = total + down - up
            high, low = x - down.args[0], x + up.args[0]
            # If the lower end is above the upper one, the sum differs from a clip.
            ordered = low == -high or (high - low).is_nonnegative
            if ordered and _bounds(high, x) and _bounds(low, x):
                return _CLIP(with_limits(x), low, high)
    return None


def _smaller(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``a - positive_part(a - high)``."""
    for part in _parts(total, -1):
        a = total + part
        high = a - part.args[0]
        if _bounds(high, a):
            inner = with_limits(a)
            if isinstance(inner, _MAX) and not inner.args[1].has(positive_part):
                return _CLIP(*inner.args, high)
            return _MIN(inner, with_limits(high))
    return None


def _larger(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``low + positive_part(a - low)``."""
    for part in _parts(total, 1):
        low = total - part
        a = low + part.args[0]
        if _bounds(low, a):
            return _MAX(with_limits(a), with_limits(low))
    return None


def _parts(total: sp.Expr, sign: int) -> list[sp.Expr]:
    return [sign * term for term in total.args if isinstance(sign * term, positive_part)]


def _bounds(bound: sp.Expr, x: sp.Expr) -> bool:
    """Return True if an expression can be an end of the range of x: it has no symbol in common with x."""
    return x != 0 and not bound.has(positive_part) and not bound.free_symbols & x.free_symbols


class ReadingOrder:
    """A sympy printer whose sums begin with the positive terms."""

    def _as_ordered_terms(self, expr: sp.Expr, order: str | None = None) -> list[sp.Expr]:
        printer: Any = super()
        terms: list[sp.Expr] = printer._as_ordered_terms(expr, order=order)
        return sorted(terms, key=lambda term: bool(term.could_extract_minus_sign()))

    def _print_moved(self, expression: sp.Expr) -> Any:
        mass, rate = expression.args
        printer: Any = self
        return f"{printer.parenthesize(mass, PRECEDENCE['Mul'], strict=True)} {printer._print(rate)}"
