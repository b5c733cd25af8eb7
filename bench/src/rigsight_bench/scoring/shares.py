"""Shares, means and medians over trials, with 95 % intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from scipy.stats import binomtest, quantile_test

Item = TypeVar("Item")

_TWO_SIDED = 1.96
"""Standard deviations of a 95 % interval."""


@dataclass(frozen=True)
class Share:
    """A count out of a total, with the Wilson interval of 95 %."""

    count: int
    total: int

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the share; everything where nothing was tried."""
        if self.total == 0:
            return 0.0, 1.0
        found = binomtest(self.count, self.total).proportion_ci(confidence_level=0.95, method="wilson")
        return float(found.low), float(found.high)

    def to_json(self) -> dict[str, Any]:
        """Return count, total, share and interval."""
        share = self.count / self.total if self.total else None
        return {"count": self.count, "total": self.total, "share": share, "interval": list(self.interval)}


def share_of(items: Sequence[Item], counts: Callable[[Item], bool]) -> dict[str, Any]:
    """Return the share of items that count, ready for JSON."""
    return Share(sum(map(counts, items)), len(items)).to_json()


def mean(values: Sequence[float]) -> float | None:
    """Return the mean; None if there are no values."""
    return float(np.mean(values)) if len(values) else None


def mean_interval(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Return where the mean of many such trials lies, by the central limit theorem; None, without limit, below two."""
    if len(values) < 2:
        return None, None
    middle = float(np.mean(values))
    half = _TWO_SIDED * float(np.std(values, ddof=1)) / math.sqrt(len(values))
    return middle - half, middle + half


def quantile(values: Sequence[float], share: float) -> float | None:
    """Return the value that this share of all does not exceed; None if there are no values, or it is infinite."""
    if not len(values):
        return None
    found = float(np.quantile(values, share, method="inverted_cdf"))
    return found if math.isfinite(found) else None


def median(values: Sequence[float]) -> float | None:
    """Return the median; None if there are no values, or half of them are infinite."""
    if not len(values):
        return None
    # Sorted, because the mean of two infinite values may be NaN.
    ordered = np.sort(values)
    low, high = float(ordered[(ordered.size - 1) // 2]), float(ordered[ordered.size // 2])
    return 0.5 * (low + high) if math.isfinite(high) else None


def median_interval(values: Sequence[float]) -> tuple[float | None, float | None]:
    """Return where the median of many such trials lies, from order alone; None for an open end."""
    if not len(values):
        return None, None
    found: Any = quantile_test(np.sort(values), p=0.5).confidence_interval(0.95)
    low, high = (float(limit) if math.isfinite(limit) else None for limit in (found.low, found.high))
    return low, high
