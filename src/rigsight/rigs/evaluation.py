"""Which number does an expression of a rig's declaration have, and how does it answer to what it is made of?"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import sympy as sp


def evaluated(expression: sp.Expr | None, values: Mapping[str, float]) -> float:
    """Return the number that an expression of declared names has.

    Parameters
    ----------
    expression
        Of constants and parameters of a rig; None is a programming error, allowed in the type because a rig may lack an inertia.
    values
        Number of each name, in SI units.

    Raises
    ------
    KeyError
        If a name has no number.
    """
    assert expression is not None
    function, names = _function(expression)
    return float(function(*(values[name] for name in names)))


def relative_slopes(expression: sp.Expr, values: Mapping[str, float]) -> dict[str, float]:
    """Return the relative change of an expression for one of each of its names: its powers, where it is a product.

    Parameters
    ----------
    expression, values
        As for `evaluated`.
    """
    return {
        symbol.name: evaluated(sp.diff(expression, symbol) * symbol / expression, values)
        for symbol in sorted(expression.free_symbols, key=str)
    }


@lru_cache(maxsize=1024)
def _function(expression: sp.Expr) -> tuple[Callable[..., Any], tuple[str, ...]]:
    symbols = sorted(expression.free_symbols, key=str)
    return sp.lambdify(symbols, expression, "math"), tuple(symbol.name for symbol in symbols)
