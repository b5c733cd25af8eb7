"""One effect at given nonlinear parameters, as columns of the equations of motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.identify.rig_equations import FUNCTIONS

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Term:
    """An effect at given nonlinear parameters, as columns of the equations."""

    effect: Effect  # with its place
    inner: Mapping[str, float]  # values of its nonlinear parameters
    names: tuple[str, ...]  # of its linear parameters, one for each part; empty where a part is no parameter
    units: tuple[float, ...]  # value of the linear parameter that a column stands for
    # Of each record, filtered and thinned, shape (n_parts, n_equations, n_rows) each.
    columns: tuple[Floats, ...]
    one_sided: tuple[bool, ...]  # whether a coefficient cannot be negative


@lru_cache(maxsize=256)
def compiled(expression: sp.Expr, arguments: tuple[sp.Symbol, ...]) -> Callable[..., Floats]:
    """Return a law as a function of a signal, shape (n_samples,), and numbers."""
    function = sp.lambdify(arguments, expression, [FUNCTIONS, "numpy"])
    return lambda signal, *numbers: np.broadcast_to(function(signal, *numbers), signal.shape).astype(
        np.float64
    )
