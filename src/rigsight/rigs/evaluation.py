"""Value of an expression of a rig's declaration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp

from rigsight.errors import InputError

_KINKS = {"positive_part": lambda value: max(value, 0.0)}


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
    InputError
        If the expression has no real value there: a root of a negative number, a division by zero.
    """
    assert expression is not None
    function, names = _function(expression)
    numbers = {name: values[name] for name in names}
    try:
        return float(function(*numbers.values()))
    except (ArithmeticError, ValueError, TypeError):
        at = ", ".join(f"{name} = {value:g}" for name, value in numbers.items())
        raise InputError(f"'{expression}' has no real value at {at}.") from None


def array_function(
    symbols: Sequence[sp.Symbol], expression: sp.Expr | sp.ImmutableMatrix
) -> Callable[..., Any]:
    """Return a function of numbers or arrays for the value of an expression of a rig's declaration."""
    modules = [{"positive_part": lambda value: np.maximum(value, 0.0)}, "numpy"]
    function: Callable[..., Any] = sp.lambdify(symbols, expression, modules, cse=True)
    return function


@lru_cache(maxsize=1024)
def _function(expression: sp.Expr) -> tuple[Callable[..., Any], tuple[str, ...]]:
    symbols = sorted(expression.free_symbols, key=str)
    return sp.lambdify(symbols, expression, [_KINKS, "math"]), tuple(symbol.name for symbol in symbols)
