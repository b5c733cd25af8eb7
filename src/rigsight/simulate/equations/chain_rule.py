"""Derivatives of long expressions from the derivatives of their parts.

The derivative of a whole expression repeats its factors, and takes most of sympy's time. The derivatives of the parts are short,
and the chain rule combines them: A. Griewank and A. Walther, Evaluating Derivatives (2008), 3.1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.simulate.equations.linear_forms import slope
from rigsight.simulate.equations.straight_line import StraightLine, in_order, of_parts


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
