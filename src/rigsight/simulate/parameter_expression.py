"""Value of an expression of a structure's parameters: a limit of a state, a delay."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.simulate.equations.structure import Structure


def at_parameters(structure: Structure, expression: sp.Expr, p: NDArray[np.float64]) -> Any:
    """Return the value of an expression."""
    return _function(structure.parameter_symbols, expression)(*p)


@lru_cache(maxsize=1024)
def _function(symbols: tuple[sp.Symbol, ...], expression: sp.Expr) -> Any:
    return sp.lambdify(symbols, expression, "numpy")
