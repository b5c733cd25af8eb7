"""Limits of each state of a structure for given parameter values."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.simulate.equations.structure import Structure


def state_limits(structure: Structure, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the half-width of the range that each state cannot leave, infinite for a free state.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values in the order of the structure, shape (n_parameters, n_sets).

    Returns
    -------
    Shape (n_states, n_sets).
    """
    limits = np.full((len(structure.equations), p.shape[1]), np.inf)
    for i, equation in enumerate(structure.equations):
        if equation.limit is not None:
            limits[i] = _function(structure.parameter_symbols, equation.limit)(*p)
    return limits


@lru_cache(maxsize=1024)
def _function(symbols: tuple[sp.Symbol, ...], limit: sp.Expr) -> Any:
    return sp.lambdify(symbols, limit, "numpy")
