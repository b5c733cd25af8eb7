"""Is a parameter the same in every group, and if not, does it rise or fall with an ordering of the groups?

References
----------
W. G. Cochran, J. R. Stat. Soc. Suppl. 4 (1937) 102, for the test of homogeneity by weighted squares. B. L. Welch, Biometrika 38
(1951) 330, for the same where the variances are estimated, each with its degrees of freedom. S. Holm, Scand. J. Stat. 6 (1979)
65, for several tests. R. E. Barlow, D. J. Bartholomew, J. M. Bremner and H. D. Brunk, *Statistical Inference under Order
Restrictions* (Wiley 1972), for the best monotonic trend.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression
from scipy.stats import chi2, norm
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from rigsight.diagnose.policy import TRUST

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """Difference of a parameter between groups."""

    p_value: float  # probability of such differences if the parameter is the same in all
    # The largest difference from the mean of all groups, in standard errors of that difference; with few
    # degrees of freedom, the equivalent number of standard errors with the same probability.
    largest: float


def spread(values: Floats, variances: Floats, freedom: Floats) -> Spread:
    """Return the differences of one parameter between groups."""
    weights, n = 1.0 / variances, values.size
    total = float(np.sum(weights))
    away = values - float(weights @ values) / total
    uneven = float(np.sum((1.0 - weights / total) ** 2 / freedom))
    q = float(weights @ away**2)
    ratio = q / (n - 1) / (1.0 + 2.0 * (n - 2) / (n**2 - 1) * uneven)
    p_value = float(f_distribution.sf(ratio, n - 1, (n**2 - 1) / (3.0 * uneven)))
    alone = np.maximum(variances - 1.0 / total, np.finfo(float).tiny)
    return Spread(p_value, max(map(standard_errors, np.abs(away) / np.sqrt(alone), freedom)))


def standard_errors(ratio: float, freedom: float) -> float:
    """Return the number of known standard errors with the same probability as this number of estimated ones (Student)."""
    return float(-norm.ppf(np.maximum(t_distribution.sf(ratio, freedom), np.finfo(float).tiny)))


def adjusted(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for multiple tests (Holm)."""
    order, found, largest = np.argsort(p_values), [1.0] * len(p_values), 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[int(index)]))
        found[int(index)] = largest
    return found


@dataclass(frozen=True)
class Course:
    """Trend of a parameter with a quantity."""

    direction: int  # 1 if it rises, -1 if it falls, 0 otherwise
    remainder: float  # weighted sum of squares about the best monotonic trend


def course(values: Floats, variances: Floats, along: Floats) -> Course:
    """Return whether values of one parameter rise or fall with a quantity."""
    levels, place = np.unique(along, return_inverse=True)
    weights = 1.0 / variances
    total = np.bincount(place, weights)
    means = np.bincount(place, weights * values) / total
    whole = float(weights @ (values - float(weights @ values) / np.sum(weights)) ** 2)
    found = Course(0, whole)
    for direction in (1, -1) if levels.size > 1 else ():
        best = direction * isotonic_regression(direction * means, weights=total).x
        remainder = float(weights @ (values - best[place]) ** 2)
        freedom = max(1, values.size - np.unique(best).size)
        in_order = remainder <= (1.0 - TRUST.in_order) * whole or chi2.sf(remainder, freedom) > TRUST.level
        if np.ptp(best) > 0.0 and in_order and remainder < found.remainder:
            found = Course(direction, remainder)
    return found
