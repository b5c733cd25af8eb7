"""Which stretches of a residual count as independent? Means over blocks long enough, for resampling.

References
----------
H. R. Kuensch, Ann. Statist. 17 (1989) 1217, for the block bootstrap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 1000
_MIN_BLOCKS = 8


def block_means(series: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the mean of each block of each series, shape (n_blocks, ...).

    Parameters
    ----------
    series
        Per record, shape (n_samples, ...); the records share the block length.
    """
    total = sum(len(s) for s in series)
    length = max(1, total // max(_MIN_BLOCKS, min(100, total // 200)))
    blocks = []
    for s in series:
        count = max(1, len(s) // length)
        blocks += [np.mean(part, axis=0) for part in np.array_split(s, count)]
    return np.array(blocks)
