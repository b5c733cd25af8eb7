"""What is the next of several numbers, each known with a variance of its own? Its prediction, as in a meta-analysis.

References
----------
R. DerSimonian and N. Laird, Control. Clin. Trials 7 (1986) 177, for the variance between records. J. P. T. Higgins, S. G.
Thompson and D. J. Spiegelhalter, J. R. Stat. Soc. A 172 (2009) 137, for the prediction of a further one by Student's
distribution.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as t_distribution

from rigsight.records.record import Floats

_CERTAIN = 1e6
"""Degrees of freedom of a normal distribution."""


@dataclass(frozen=True)
class Prediction:
    """Distribution of a further number, but for the variance of its own."""

    mean: float
    between: float  # variance between the numbers beyond those of their own
    of_mean: float  # variance of the mean
    freedom: float

    @classmethod
    def of(cls, values: Floats, variances: Floats) -> Prediction:
        """Return the prediction from numbers with their variances, shape (n,) each."""
        weights = 1.0 / variances
        total, n = float(np.sum(weights)), values.size
        away = float(weights @ (values - float(weights @ values) / total) ** 2)
        spare = total - float(np.sum(weights**2)) / total
        between = max(0.0, (away - (n - 1)) / spare) if n > 1 else 0.0
        weights = 1.0 / (variances + between)
        mean = float(weights @ values / np.sum(weights))
        # A single number does not show how numbers differ.
        return cls(mean, between, 1.0 / float(np.sum(weights)), float(n - 1) if n > 1 else _CERTAIN)

    def scatter(self, variance: float) -> float:
        """Return the scatter of a further number with this variance of its own."""
        return math.sqrt(self.between + self.of_mean + variance)

    def exceeded(self, value: float, variance: float) -> float:
        """Return the probability that a further number exceeds a value."""
        return float(t_distribution.sf((value - self.mean) / self.scatter(variance), self.freedom))

    def quantile(self, probability: float, variance: float) -> float:
        """Return what a further number exceeds with this probability."""
        return self.mean + self.scatter(variance) * float(t_distribution.isf(probability, self.freedom))
