"""Products of unknown parameters in a long expression, and the factor of each.

Known factors are not expanded: the forces of an arm with six joints have some twenty products of its parameters, but tens of
thousands of terms.
"""

from __future__ import annotations

from collections.abc import Iterable

import sympy as sp

_MOST_FACTORS = 6
"""Largest power that is expanded; energies contain squares, and potentials somewhat higher powers."""


class MixedError(ValueError):
    """Unknown parameters and signals cannot be separated."""


def parameter_products(
    expression: sp.Expr, unknown: frozenset[sp.Symbol], signals: frozenset[sp.Symbol]
) -> dict[sp.Expr, sp.Expr]:
    """Return the products of unknown parameters in an expression, each with its factor."""
    found: dict[sp.Expr, dict[sp.Expr, sp.Expr]] = {}

    def products(own: sp.Expr) -> dict[sp.Expr, sp.Expr]:
        if own not in found:
            found[own] = split_distinguishable(own)
        return found[own]

    def split_distinguishable(own: sp.Expr) -> dict[sp.Expr, sp.Expr]:
        if not own.free_symbols & unknown:
            return {sp.S.One: own}
        if own.is_Add:
            return _summed(pair for part in own.args for pair in products(part).items())
        if own.is_Mul:
            return _multiplied(map(products, own.args))
        if own.is_Pow and own.exp.is_Integer and 1 < own.exp <= _MOST_FACTORS:
            return _multiplied([products(own.base)] * int(own.exp))
        if own.free_symbols & signals:
            raise MixedError(str(own))
        return {own: sp.S.One}

    return products(expression)


def _summed(pairs: Iterable[tuple[sp.Expr, sp.Expr]]) -> dict[sp.Expr, sp.Expr]:
    parts: dict[sp.Expr, list[sp.Expr]] = {}
    for product, factor in pairs:
        parts.setdefault(product, []).append(factor)
    return {product: sp.Add(*factors) for product, factors in parts.items()}


def _multiplied(factors: Iterable[dict[sp.Expr, sp.Expr]]) -> dict[sp.Expr, sp.Expr]:
    whole: dict[sp.Expr, sp.Expr] = {sp.S.One: sp.S.One}
    for factor in factors:
        whole = _summed((a * b, x * y) for a, x in whole.items() for b, y in factor.items())
    return whole
