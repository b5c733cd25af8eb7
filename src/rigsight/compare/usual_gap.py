"""Which gap is usual for a model? The gap of a further record like those that are known, with the scatter between records.

The logarithm of the mean square of a residual scatters for two reasons: a residual holds only so many independent values, and
records differ.

References
----------
M. S. Bartlett and D. G. Kendall, Suppl. J. R. Stat. Soc. 8 (1946) 128, for the logarithm of a variance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import digamma, polygamma
from scipy.stats import t as t_distribution

from rigsight.identify import DEFAULT_ACCURACY
from rigsight.records.record import Floats

_CERTAIN = 1e6
"""Degrees of freedom of a normal distribution."""


@dataclass(frozen=True)
class KnownGap:
    """The gap of a model in one output of one record."""

    record: str
    output: str
    rms: float  # of measured minus simulated, in the unit of the output
    freedom: float  # degrees of freedom of its mean square
    duration: float  # of the record [s]
    moved: float  # RMS of the output about its mean

    @property
    def counted(self) -> float:
        """The RMS, at least what the accuracy of the simulations makes of a perfect model."""
        return max(self.rms, DEFAULT_ACCURACY * self.moved, float(np.finfo(np.float64).tiny))


@dataclass(frozen=True)
class UsualGap:
    """The gaps of a model in one output of the records for which it is known to hold, one at least."""

    known: tuple[KnownGap, ...]

    @classmethod
    def of(cls, known: Sequence[KnownGap], output: str) -> UsualGap | None:
        """Return the gaps in an output; None where no record holds it."""
        own = tuple(gap for gap in known if gap.output == output)
        return cls(own) if own else None

    @property
    def center(self) -> float:
        """The RMS of a typical record."""
        return math.exp(0.5 * self._logarithms.mean)

    @property
    def farthest(self) -> float:
        """The largest RMS of the motion in these records."""
        return max(gap.moved for gap in self.known)

    def limit(self, duration: float, false_alarms: float) -> float:
        """Return the RMS that a further record exceeds with this probability if the model holds for it."""
        freedom = self._freedom(duration)
        return math.exp(0.5 * (self._logarithms.quantile(false_alarms, _variance(freedom)) + _bias(freedom)))

    def p_value(self, rms: float, duration: float) -> float:
        """Return the probability that a further record has at least this RMS if the model holds for it."""
        freedom = self._freedom(duration)
        logarithm = 2.0 * math.log(max(rms, float(np.finfo(np.float64).tiny)))
        return self._logarithms.exceeded(logarithm - _bias(freedom), _variance(freedom))

    def _freedom(self, duration: float) -> float:
        """Return the degrees of freedom of a record of this duration."""
        # A drifted residual is no measure of how many independent values a true one has: those known tell it.
        per_second = sum(gap.freedom for gap in self.known) / sum(gap.duration for gap in self.known)
        return max(1.0, per_second * duration)

    @cached_property
    def _logarithms(self) -> Prediction:
        return Prediction.of(
            np.array([2.0 * math.log(gap.counted) - _bias(gap.freedom) for gap in self.known]),
            np.array([_variance(gap.freedom) for gap in self.known]),
        )


def _bias(freedom: float) -> float:
    """Return the mean of the logarithm of a mean square whose expected value is one."""
    return float(digamma(0.5 * freedom)) - math.log(0.5 * freedom)


def _variance(freedom: float) -> float:
    """Return the variance of the logarithm of a mean square."""
    return float(polygamma(1, 0.5 * freedom))


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
