"""Accelerations, found by elimination, that jump when a kink changes sign. Determined numerically at an arbitrary point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.simulate.elimination import Elimination
from rigsight.simulate.straight_line import straight_line

_DIGITS = 40
"""Of the numbers: what is smaller than 1e-25 of them then comes of rounding."""


class Jumps:
    """How accelerations that are found by elimination change with symbols in the equations.

    Parameters
    ----------
    elimination
        How they are found.
    steps
        The steps to them, of functions that sympy has numbers for.
    still
        Velocities -> what others make them where a joint rests, of symbols other than `steps`.
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
        """Return the derivative of each acceleration by a symbol in masses and loads."""
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
        """Return the numbers of expressions at the place.

        Parameters
        ----------
        expressions
            Of states, inputs, parameters and steps.
        further
            Steps behind those to the accelerations.
        """
        line = straight_line(expressions, {**self._steps, **(further or {})})
        numbers = dict(self._place)
        for symbol, part in line.parts.items():
            numbers[symbol] = _number(part, numbers)
        return [_number(result, numbers) for result in line.results]


def _number(expression: sp.Expr, numbers: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    return expression.xreplace(numbers).evalf(_DIGITS)


def _slope(expression: sp.Expr, symbol: sp.Symbol) -> sp.Expr:
    # Term by term: of a long sum few terms hold it.
    terms = [term for term in sp.Add.make_args(expression) if symbol in term.free_symbols]
    return sp.Add(*(sp.diff(term, symbol) for term in terms))
