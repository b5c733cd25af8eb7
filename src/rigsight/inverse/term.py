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

_SIZED = 1.5
"""Factor by which the coefficient of a force of known size may differ from one (an assumption): that of the law beside it."""


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
    most: tuple[
        float, ...
    ] = ()  # size of each coefficient that fits reach at most; empty where they have no such limit
    is_given: bool = False  # whether the column is a force, not that of a unit of a number
    is_sized: bool = False  # whether the column is a force whose coefficient must come out near one

    def allows(self, coefficients: Floats) -> bool:
        """Return whether coefficients, shape (n_parts,), have the sign, size and order that the effect needs."""
        if self.is_sized and not np.all((coefficients > 1.0 / _SIZED) & (coefficients < _SIZED)):
            return False
        if any(sided and own < 0.0 for sided, own in zip(self.one_sided, coefficients, strict=True)):
            return False
        if any(abs(own) > most for most, own in zip(self.most, coefficients, strict=False)):
            return False
        numbers = {
            name: own * unit for name, own, unit in zip(self.names, coefficients, self.units, strict=False)
        }
        if self.effect.holds_constant_force and sum(numbers.values()) < 0.0:
            return False  # Beside a constant force friction may push one way, but not both.
        pairs = [pair for pair in self.effect.ordered if set(pair) <= numbers.keys()]
        return all(numbers[larger] >= numbers[smaller] for larger, smaller in pairs)


@lru_cache(maxsize=256)
def compiled(expression: sp.Expr, arguments: tuple[sp.Symbol, ...]) -> Callable[..., Floats]:
    """Return a law as a function of a signal, shape (n_samples,), and numbers."""
    function = sp.lambdify(arguments, expression, [FUNCTIONS, "numpy"])
    return lambda signal, *numbers: np.broadcast_to(function(signal, *numbers), signal.shape).astype(
        np.float64
    )
