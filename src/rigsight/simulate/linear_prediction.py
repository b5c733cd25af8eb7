"""Extrapolation of a sampled signal beyond its ends, for smoothing and interpolation."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

_ORDER, _KNOWN = 24, 240
"""Samples that a prediction weighs, enough for twelve tones, and samples at the end to which it is fitted."""
_RANK = 1e-12
"""Share of the largest power below which a direction is rounding error; samples of a few tones are linearly dependent."""


def continued(samples: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return a signal with additional samples before its beginning and after its end, by linear prediction.

    A reflection about the last sample would reverse the curvature there: the slope at the end of an interpolation would be off by
    as much as a tenth of its size.

    References
    ----------
    S. M. Kay, *Modern Spectral Estimation* (Prentice Hall 1988), chapter 7, for the modified covariance method.
    """
    return np.concatenate([_following(samples[::-1], count)[::-1], samples, _following(samples, count)])


def _following(samples: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    order, known = min(_ORDER, samples.size // 3), samples[-_KNOWN:]
    mean, low, high = float(np.mean(known)), float(np.min(known)), float(np.max(known))
    if order == 0 or low == high:
        return np.full(count, samples[-1])
    # Scaled to unit size, because squares of a diverging motion may overflow although its prediction does not.
    rows = sliding_window_view((known - mean) / max(high - mean, mean - low), order + 1)
    regressors = np.vstack([rows[:, -2::-1], rows[:, 1:]])
    # Normal equations: ten times as fast as a singular value decomposition, and this runs for every window of every record.
    powers, directions = np.linalg.eigh(regressors.T @ regressors)
    directions, powers = directions[:, powers > _RANK * powers[-1]], powers[powers > _RANK * powers[-1]]
    reported = directions.T @ (regressors.T @ np.concatenate([rows[:, -1], rows[:, 0]]))
    weights = directions @ (reported / powers)
    # Limited, because noise may make the prediction unstable.
    lowest, highest = 2.0 * low - high - mean, 2.0 * high - low - mean
    latest = (known - mean)[: -order - 1 : -1].tolist()
    for _ in range(count):
        latest.insert(0, min(max(float(weights @ latest[:order]), lowest), highest))
    return mean + np.array(latest[count - 1 :: -1])
