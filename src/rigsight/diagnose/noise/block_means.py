"""Which stretches of a residual count as independent? Means over blocks long enough, for resampling.

References
----------
H. R. Kuensch, Ann. Statist. 17 (1989) 1217, for the block bootstrap. W. G. Cochran, "Sampling Techniques" (3rd ed. 1977),
eq. 2.39, for the error of a mean over blocks of unequal sizes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Floats

_RESAMPLES = 1000
_MIN_BLOCKS = 8


@dataclass(frozen=True)
class Blocks:
    """Means over the blocks of series."""

    means: Floats  # shape (n_blocks, n_series)
    # Number of values in each block, shape (n_blocks,); blocks of short records are smaller.
    sizes: Floats

    @property
    def mean(self) -> Floats:
        """Mean over all values, shape (n_series,)."""
        return np.asarray(np.average(self.means, axis=0, weights=self.sizes))

    @property
    def standard_error(self) -> Floats:
        """Standard error of `mean`, shape (n_series,); infinite for a single block."""
        if self.sizes.size == 1:
            return np.full(self.means.shape[1], np.inf)
        off = self.sizes[:, None] * (self.means - self.mean)
        return np.asarray(np.sqrt(np.sum(off**2, axis=0)) / np.sum(self.sizes))

    def draws(self, rng: np.random.Generator) -> NDArray[np.int64]:
        """Return the numbers of the blocks in each resampling, shape (n_resamples, n_blocks)."""
        return rng.integers(0, self.sizes.size, size=(_RESAMPLES, self.sizes.size))

    def resampled(self, draws: NDArray[np.int64]) -> Floats:
        """Return the mean over the values of each resampling, shape (n_resamples, n_series)."""
        sizes = self.sizes[draws]
        total = np.einsum("ij,ijk->ik", sizes, self.means[draws])
        return np.asarray(total / np.sum(sizes, axis=1, keepdims=True))


def blocks_of(series: Sequence[Floats], n_values: Sequence[NDArray[np.int64]] | None = None) -> Blocks:
    """Return the means over blocks of series."""
    counted = n_values or [np.ones(len(s), dtype=np.int64) for s in series]
    total = sum(len(s) for s in series)
    length = max(1, total // max(_MIN_BLOCKS, min(100, total // 200)))
    means, sizes = [], []
    for samples, counts in zip(series, counted, strict=True):
        n_blocks = max(1, len(samples) // length)
        for part, weights in zip(
            np.array_split(samples, n_blocks), np.array_split(counts, n_blocks), strict=True
        ):
            known = weights > 0
            if known.any():
                means.append(np.average(part[known], axis=0, weights=weights[known]))
                sizes.append(float(np.sum(weights)))
    return Blocks(np.array(means), np.array(sizes))


def squared_errors(models: Sequence[Sequence[Floats]], noise: Floats) -> Blocks:
    """Return the squared residuals of models in units of the noise floor, a series per model."""
    # The square root of a model's mean is its `error_over_noise`.
    records = list(zip(*models, strict=True))
    counts = [np.sum(np.isfinite(of_models[0]), axis=1) for of_models in records]
    squares = [
        np.column_stack([np.nansum((residual / noise) ** 2, axis=1) for residual in of_models])
        / np.maximum(count, 1)[:, None]
        for of_models, count in zip(records, counts, strict=True)
    ]
    return blocks_of(squares, counts)
