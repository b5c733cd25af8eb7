"""Derivatives of accelerations that are computed by elimination.

The linear system is differentiated instead of the elimination: ``mass @ da = d(loads) - d(mass) @ a``, which is solved with the
existing factors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from rigsight.simulate.equations.chain_rule import slopes_of
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.straight_line import straight_line


@dataclass(frozen=True)
class EliminatedForms:
    """Changes of expressions that contain accelerations."""

    # Symbol -> the derivative or part of the elimination that it denotes; they are the same for all changes.
    factors: Mapping[sp.Symbol, sp.Expr]
    parts: Mapping[sp.Symbol, sp.Expr]  # symbols in the factors -> their expressions, in any order
    # Symbols in the sums -> their expressions in factors, constants and changes: the changes of the
    # accelerations.
    steps: Mapping[sp.Symbol, sp.Expr]
    sums: tuple[sp.Expr, ...]  # change of each expression, in terms of factors, constants, changes and steps


def eliminated_forms(
    expressions: Sequence[sp.Expr],
    changes: Mapping[sp.Symbol, sp.Expr],
    constants: set[sp.Symbol],
    elimination: Elimination,
    steps: Mapping[sp.Symbol, sp.Expr],
) -> EliminatedForms:
    """Return the changes of expressions with accelerations due to changes of symbols, with all signs held constant."""
    n, begun = elimination.size, elimination.begun(steps)
    by = [*changes, *elimination.accelerations]
    whole = straight_line([*elimination.left, *expressions], begun)
    line = slopes_of(whole, by)
    rows = [line.results[i * len(by) : (i + 1) * len(by)] for i in range(n + len(expressions))]
    factors: dict[sp.Expr, sp.Symbol] = {}

    def factor(value: sp.Expr) -> sp.Expr:
        if value.is_number or value in constants:
            return value
        return factors.setdefault(value, sp.Symbol(f"factor {len(factors)}", real=True))

    def total(slopes: Sequence[sp.Expr], of: Sequence[sp.Expr]) -> sp.Expr:
        return sp.Add(
            *(factor(slope) * change for slope, change in zip(slopes, of, strict=True) if slope != 0)
        )

    own = list(changes.values())
    solved = elimination.solved([total(row[: len(own)], own) for row in rows[:n]], "change")
    sums = tuple(total(row, [*own, *elimination.solution("change")]) for row in rows[n:])
    known = {s for step in solved.values() for s in step.free_symbols if s in elimination.steps}
    kept = {s: factor(s) for s in sorted(known, key=str)}
    return EliminatedForms(
        {symbol: value for value, symbol in factors.items()},
        {**whole.parts, **line.parts, **elimination.steps},
        {symbol: step.xreplace(kept) for symbol, step in solved.items()},
        sums,
    )
