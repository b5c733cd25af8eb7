"""Jumps of accelerations (from elimination) when a kink changes sign, determined numerically at an arbitrary point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.straight_line import straight_line

_DIGITS = 40
"""Digits of the numbers; a result below 1e-25 is then rounding error."""


class Jumps:
    """Derivatives of accelerations that are computed by elimination, with respect to symbols in the equations.

    Parameters
    ----------
    elimination
        The elimination.
    steps
        The steps to the accelerations, in functions that sympy can evaluate.
    still
        Velocities -> their expressions in the other velocities while a joint rests, without symbols of `steps`.
    """

    def __init__(
        self,
        elimination: Elimination,
        steps: Mapping[sp.Symbol, sp.Expr],
        still: Mapping[sp.Symbol, sp.Expr],
    ) -> None:
        self._elimination, self._steps = elimination, steps
        known = set().union(*(e.free_symbols for e in (*steps.values(), *still.values(), *still))) - set(
            steps
        )
        ordered = enumerate(sorted(known, key=str))
        self._place = {s: (sp.sqrt(sp.prime(5 + i)) / (3 + i % 7)).evalf(_DIGITS) for i, s in ordered}
        self._place |= {velocity: _number(value, self._place) for velocity, value in still.items()}

    def by(self, mode: sp.Symbol) -> list[sp.Expr]:
        """Return the derivative of each acceleration with respect to a symbol in masses and loads."""
        steps, elimination = self._steps, self._elimination
        pushes = [
            _slope(steps[load], mode)
            - sp.Add(*(_slope(steps[mass], mode) * a for mass, a in elimination.moved(i)))
            for i, load in enumerate(elimination.loads)
        ]
        solved = elimination.solved(pushes, "jump")
        return self.numbers(elimination.solution("jump"), solved)

    def numbers(
        self, expressions: Sequence[sp.Expr], further: Mapping[sp.Symbol, sp.Expr] | None = None
    ) -> list[sp.Expr]:
        """Return the values of expressions at the point."""
        line = straight_line(expressions, {**self._steps, **(further or {})})
        numbers = dict(self._place)
        for symbol, part in line.parts.items():
            numbers[symbol] = _number(part, numbers)
        return [_number(result, numbers) for result in line.results]


def _number(expression: sp.Expr, numbers: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    return expression.xreplace(numbers).evalf(_DIGITS)


def _slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    # Term by term, because few terms of a long sum contain the symbol.
    terms = [term for term in sp.Add.make_args(expression) if symbol in term.free_symbols]
    return sp.Add(*(derivative(term, symbol) for term in terms))
