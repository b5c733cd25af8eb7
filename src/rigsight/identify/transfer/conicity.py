"""Equivalent conicity delta_0 from the creep factor, and the accuracy with which records can determine it.

delta_0 enters the equations of the rig only in the product v c_y, with ``c_y = cos^2 d - (2 r_0 / b) sin d cos d`` (thesis,
2.12). So in every record, for any input, the sensitivity to delta_0 is the sensitivity to ln c_y times ``(dc_y/dd) / c_y``, and
the Cramer-Rao bound of delta_0 is that of c_y over ``|dc_y/dd|``, about 0.7 on this rig: an error of 1 % of c_y, of the speed v,
or of the ratio of the two sensors' scales causes one of 0.014 rad. No record or static relation avoids this; only the accuracy
of c_y can be improved, by a sine at the break frequency or a known l_0 (`experiments/thesis/thesis_formulas.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import sympy as sp
from scipy.optimize import brentq

from rigsight.effects.symbols import derivative
from rigsight.errors import InputError
from rigsight.identify.fit.covariance import LEVEL, normal_interval
from rigsight.rigs import built_in, evaluated

PLAUSIBLE = 0.3
"""Largest plausible conicity of profiled wheels [rad]; an interval that covers the whole range determines nothing. A choice, far
above the thesis's 0.05."""


@dataclass(frozen=True)
class ConicityEstimate:
    """Equivalent conicity with its interval and a statement in words."""

    # Estimate limited to the range of (2.12), from 0 to the conicity at which c_y is zero [rad].
    value: float
    # Root of (2.12) without this limit [rad], such as the thesis's -0.15; None if (2.12) has none.
    unbounded: float | None
    standard_error: float  # of the unbounded value [rad], by the delta method
    # Confidence interval inside the limits [rad]; None if no admissible conicity is compatible with c_y.
    interval: tuple[float, float] | None
    # True if the interval excludes zero and is narrower than the range of plausible conicities.
    determined: bool
    statement: str  # the result in one or two sentences


def estimate_conicity(c_y: float, standard_error: float, r_0: float, b: float) -> ConicityEstimate:
    """Return delta_0 from the creep factor, limited to positive values, with its interval.

    The interval maps the normal interval of c_y through (2.12), which is monotonic between the limits: near a limit it is exact,
    unlike the delta method.

    Parameters
    ----------
    c_y, standard_error
        Creep factor and its standard error (may be infinite).
    r_0, b
        Wheel radius and track width [m].

    Raises
    ------
    InputError
        If c_y is not positive, or its error negative.
    """
    if not (c_y > 0.0 and standard_error >= 0.0):
        raise InputError(
            f"A conicity needs c_y above 0 and its standard error at least 0; got c_y = {c_y:g} +- {standard_error:g}."
        )
    largest = math.atan2(b, 2.0 * r_0)
    low_c, high_c = normal_interval(c_y, standard_error)
    top = -0.5 * math.atan(2.0 * r_0 / b)
    value = _bounded(c_y, largest, r_0, b)
    unbounded = None if c_y > creep_factor(top, r_0, b) else _root(c_y, top, largest, r_0, b)
    slope = abs(conicity_slope(value if unbounded is None else unbounded, r_0, b))
    # At the maximum of c_y its derivative is zero, and the delta method fails.
    error = standard_error / slope if unbounded is not None and slope > 0.0 else math.inf
    percent = f"{100.0 * LEVEL:g} %"
    lower, upper = _bounded(high_c, largest, r_0, b), _bounded(low_c, largest, r_0, b)
    determined, text = False, f"{percent} interval {lower:.3g} to {upper:.3g} rad"
    if low_c >= 1.0:
        value = 0.0
        statement = (
            f"c_y = {c_y:.4g} lies above 1 with its whole {percent} interval ({low_c:.4g} to {high_c:.4g}): no positive conicity "
            "gives this. Speed, sensor scales, or a lag between the sensors are wrong by more than the noise; delta_0 is not "
            "determined."
        )
    elif lower <= 0.0 and upper >= PLAUSIBLE:
        statement = (
            f"The records do not determine delta_0: its {text} covers every plausible conicity (up to {PLAUSIBLE:g} rad). "
            f"c_y would have to be known to {100.0 * 0.1 * 0.024 * slope / c_y:.1g} % to know a conicity of 0.024 rad to 10 %."
        )
    elif lower <= 0.0:
        statement = f"The records give an upper limit only: delta_0 is below {upper:.3g} rad ({percent}); zero is possible."
    else:
        determined, statement = upper - lower < PLAUSIBLE, f"delta_0 = {value:.4g} rad, {text}."
        if not determined:
            statement += (
                " It differs from zero, but its interval is wider than the range of plausible conicities."
            )
    interval = None if low_c >= 1.0 else (lower, upper)
    return ConicityEstimate(value, unbounded, error, interval, determined, statement)


def _bounded(c_y: float, largest: float, r_0: float, b: float) -> float:
    return 0.0 if c_y >= 1.0 else _root(c_y, 0.0, largest, r_0, b)


def _root(c_y: float, lowest: float, largest: float, r_0: float, b: float) -> float:
    if c_y <= creep_factor(largest, r_0, b):
        return largest
    return float(brentq(lambda delta: creep_factor(delta, r_0, b) - c_y, lowest, largest))


def creep_factor(delta_0: float, r_0: float, b: float) -> float:
    """Return c_y of (2.12) for the equivalent conicity `delta_0` [rad], wheel radius and track width [m]."""
    return evaluated(_creep_factor(), {"delta_0": delta_0, "r_0": r_0, "b": b})


def conicity_slope(delta_0: float, r_0: float, b: float) -> float:
    """Return dc_y / d delta_0 [1/rad] of (2.12)."""
    slope = derivative(_creep_factor(), sp.Symbol("delta_0", real=True))
    return evaluated(slope, {"delta_0": delta_0, "r_0": r_0, "b": b})


@cache
def _creep_factor() -> sp.Expr:
    (found,) = (a.value for a in built_in.RUNNING_GEAR.alternatives if a.parameter.name == "delta_0")
    return found
