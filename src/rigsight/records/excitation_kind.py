"""Kind and amplitude of the excitation, from the samples of the input."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.records.periods import repeated_period
from rigsight.records.record import Kind

# Share of samples that equal the one before: above it the input stands still but for a few jumps.
_STANDING = 0.9
_MOST_JUMPS = 50
# A sweep's frequency goes one way: from stretch to stretch, and by at least this ratio in all.
_FEWEST_CROSSINGS = 12
_STRETCHES = 5
_RATIO = 1.5


def guess_kind(samples: NDArray[np.float64]) -> Kind:
    """Return the kind of an input of shape (n_samples,): a guess that the user should check."""
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
    centered = samples - 0.5 * (samples.min() + samples.max())
    where = np.flatnonzero(np.abs(centered) > 0.05 * np.max(np.abs(centered)))
    signs = np.sign(centered[where])
    crossings = where[1:][signs[1:] != signs[:-1]]
    if crossings.size < _FEWEST_CROSSINGS:
        return False
    distances = [float(part.mean()) for part in np.array_split(np.diff(crossings), _STRETCHES)]
    rising = np.diff(distances) > 0.0
    ratio = max(distances[0], distances[-1]) / min(distances[0], distances[-1])
    return bool((rising.all() or not rising.any()) and ratio > _RATIO)
