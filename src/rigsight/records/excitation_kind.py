"""What drove the rig, and how strongly, as the samples of the input show it?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.records.periods import repeated_period
from rigsight.records.record import Kind

# Share of samples that equal the one before: above it the input stands still but for a few jumps.
_STANDING = 0.9
_MOST_JUMPS = 50
_FEWEST_CROSSINGS = 8
# Rank correlation of the distance between zero crossings with time: a sweep's frequency goes one way.
_ONE_WAY = 0.9


def guess_kind(samples: NDArray[np.float64]) -> Kind:
    """Return the kind of an input of shape (n_samples,): a guess that a user is asked to check."""
    steps = np.diff(samples)
    jumps = int(np.count_nonzero(steps))
    if np.mean(steps == 0.0) > _STANDING and 0 < jumps <= _MOST_JUMPS:
        return "step"
    if _is_sweep(samples):
        return "sweep"
    if repeated_period(samples) is not None:
        return "multisine"
    return "operation"


def guess_amplitude(samples: NDArray[np.float64], kind: Kind) -> float | None:
    """Return the amplitude of an input, in its unit; None for operation, which has none."""
    if kind == "operation":
        return None
    size = float(np.max(np.abs(samples - samples[0]))) if kind == "step" else 0.5 * float(np.ptp(samples))
    return float(f"{size:.3g}")


def _is_sweep(samples: NDArray[np.float64]) -> bool:
    """Return True if zero crossings become ever denser, or ever rarer."""
    from scipy.stats import spearmanr

    centered = samples - 0.5 * (samples.min() + samples.max())
    signs = np.sign(centered[np.abs(centered) > 0.05 * np.max(np.abs(centered))])
    where = np.flatnonzero(np.abs(centered) > 0.05 * np.max(np.abs(centered)))
    crossings = where[1:][signs[1:] != signs[:-1]]
    if crossings.size < _FEWEST_CROSSINGS:
        return False
    distances = np.diff(crossings)
    if np.ptp(distances) <= 2:
        return False
    return bool(abs(spearmanr(np.arange(distances.size), distances).statistic) > _ONE_WAY)
