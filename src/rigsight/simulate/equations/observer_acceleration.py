"""Correction acceleration with which an observer tracks a measured sensor.

It is an acceleration and not a force, so that the tracking does not depend on the parameters of the rig. An error e of a reading
decays with ``e'' + sqrt(2) w e' + w^2 e = 0``: the optimal observer of a free mass on which white noise acts as a force.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.rigs import Coordinate


def measured_before(shown: Sequence[sp.Expr], delay: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return value and rate of a measured motion before a delay, by a Taylor series that is valid for small delays."""
    value, rate, curvature = shown
    return value + delay * rate + delay**2 / 2 * curvature, rate + delay * curvature


def observer_acceleration(
    free: Sequence[Coordinate],
    reads: sp.Expr,
    shown: tuple[sp.Expr, sp.Expr],
    measured: tuple[sp.Expr, sp.Expr],
    bandwidth: sp.Expr,
) -> sp.Matrix:
    """Return the accelerations of the free coordinates with which the error of one sensor decays, shape (n_degrees, 1)."""
    slopes = sp.Matrix([derivative(reads, c.rate) for c in free])
    if any(slope != 0 for slope in slopes):
        wanted = bandwidth * (measured[0] - shown[0])
    else:
        slopes = sp.Matrix([derivative(reads, c.symbol) for c in free])
        wanted = bandwidth**2 * (measured[0] - shown[0]) + sp.sqrt(2) * bandwidth * (measured[1] - shown[1])
    return slopes * (wanted / slopes.dot(slopes))
