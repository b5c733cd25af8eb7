"""How does the equivalent conicity of a wheel set give its lateral creep factor? Equation (2.12) of the thesis."""

from __future__ import annotations

import math

from scipy.optimize import brentq

from rigsight.errors import InputError


def creep_factor(delta_0: float, r_0: float, b: float) -> float:
    """Return c_y of (2.12) for the equivalent conicity `delta_0` [rad], wheel radius and track width [m]."""
    return math.cos(delta_0) ** 2 - 2.0 * r_0 / b * math.sin(delta_0) * math.cos(delta_0)


def conicity(c_y: float, r_0: float, b: float) -> float:
    """Return the positive delta_0 [rad] that gives `c_y` by (2.12).

    Raises
    ------
    InputError
        If no conicity in (0, pi/2) gives this creep factor: c_y must lie below 1.
    """
    lowest = math.pi / 2
    if not creep_factor(lowest, r_0, b) - 1e-12 <= c_y < 1.0:
        raise InputError(
            f"No positive conicity gives c_y = {c_y:g}; c_y must lie in [0, 1). Give c_y itself instead of delta_0."
        )
    return float(brentq(lambda delta: creep_factor(delta, r_0, b) - c_y, 0.0, math.atan2(b, 2.0 * r_0)))
