"""Which gap is usual for a model? The gap of a further record like those that are known, with the scatter between records.

The logarithm of the mean square of a residual scatters for two reasons: a residual holds only so many independent values, and
records differ. The second is estimated from the known records, as in a meta-analysis with random effects, and a further record
lies within the prediction interval of that.

References
----------
R. DerSimonian and N. Laird, Control. Clin. Trials 7 (1986) 177, for the variance between records. J. P. T. Higgins, S. G.
Thompson and D. J. Spiegelhalter, J. R. Stat. Soc. A 172 (2009) 137, for the prediction of a further one by Student's
distribution. M. S. Bartlett and D. G. Kendall, Suppl. J. R. Stat. Soc. 8 (1946) 128, for the logarithm of a variance.
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
    """The gaps of a model in one output of the records that it is known to hold for, one at least."""

    known: tuple[KnownGap, ...]

    @classmethod
    def of(cls, known: Sequence[KnownGap], output: str) -> UsualGap | None:
        """Return the gaps in an output; None where no record holds it."""
        own = tuple(gap for gap in known if gap.output == output)
        return cls(own) if own else None

    @property
    def center(self) -> float:
        """The RMS of a typical record."""
        return math.exp(0.5 * self._found.mean)

    @property
    def farthest(self) -> float:
        """The largest RMS of the motion in these records."""
        return max(gap.moved for gap in self.known)

    def limit(self, duration: float, false_alarms: float) -> float:
        """Return the RMS that a further record exceeds with this probability if the model holds for it."""
        scatter, shift = self._of_further(duration)
        return math.exp(0.5 * (shift + scatter * float(t_distribution.isf(false_alarms, self._freedom))))

    def p_value(self, rms: float, duration: float) -> float:
        """Return the probability that a further record has at least this RMS if the model holds for it."""
        scatter, shift = self._of_further(duration)
        if rms <= 0.0:
            return 1.0
        return float(t_distribution.sf((2.0 * math.log(rms) - shift) / scatter, self._freedom))

    @property
    def _freedom(self) -> float:
        # A single record does not show how records differ.
        return float(len(self.known) - 1) if len(self.known) > 1 else _CERTAIN

    def _of_further(self, duration: float) -> tuple[float, float]:
        """Return scatter and middle of the logarithm of the mean square of a record of this duration."""
        # A drifted residual is no measure of how many independent values a true one has: those known tell it.
        per_second = sum(gap.freedom for gap in self.known) / sum(gap.duration for gap in self.known)
        freedom = max(1.0, per_second * duration)
        found = self._found
        variance = found.between + found.of_mean + float(polygamma(1, 0.5 * freedom))
        return math.sqrt(variance), found.mean + _bias(freedom)

    @cached_property
    def _found(self) -> _Between:
        values = np.array([2.0 * math.log(gap.counted) - _bias(gap.freedom) for gap in self.known])
        chance = np.array([float(polygamma(1, 0.5 * gap.freedom)) for gap in self.known])
        weights = 1.0 / chance
        total = float(np.sum(weights))
        away = float(weights @ (values - float(weights @ values) / total) ** 2)
        spare = total - float(np.sum(weights**2)) / total
        between = max(0.0, (away - (values.size - 1)) / spare) if values.size > 1 else 0.0
        weights = 1.0 / (chance + between)
        return _Between(float(weights @ values / np.sum(weights)), between, 1.0 / float(np.sum(weights)))


@dataclass(frozen=True)
class _Between:
    """Logarithms of mean squares: their mean, their variance between records beyond chance, and the variance of the mean."""

    mean: float
    between: float
    of_mean: float


def _bias(freedom: float) -> float:
    """Return the mean of the logarithm of a mean square whose expected value is one."""
    return float(digamma(0.5 * freedom)) - math.log(0.5 * freedom)
