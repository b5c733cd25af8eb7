"""How often sparse regression selects each term when the records are drawn again: pysindy's optimizer on dimensionless columns.

Rows are stored as a triangular factor with the same
normal equations and a few hundred times fewer rows.

References
----------
L. Boninsegna, F. Nueske and C. Clementi, J. Chem. Phys. 148 (2018) 241723, for stepwise sparse regression; U. Fasel et al.,
Proc. R. Soc. A 478 (2022) 20210904, for inclusion probabilities from ensembles.
"""

from __future__ import annotations

import warnings

import numpy as np

from rigsight.records.record import Floats

_N_ENSEMBLE = 40
_N_BLOCKS = 40
"""Number of contiguous stretches of rows that an ensemble draws from; stretches because neighboring rows share their noise."""
_CLEARLY = 1.1
"""Factor by which a larger support must lower the residual: columns from a smoothed motion are not more accurate than this."""
_RIDGE = 1e-12
Support = tuple[int, ...]


def inclusion_probabilities(
    terms: Floats, target: Floats, independent: float, rng: np.random.Generator
) -> Floats:
    """Return the share of draws of stretches of the rows in which each term is selected, shape (n_terms,).

    The support of a draw is the smallest whose residual hardly exceeds that of the support with the lowest Bayesian information
    criterion. Terms of shape (n_rows, n_terms) and the force of shape (n_rows,) are without what the numbers of the rig do.
    """
    blocks = np.array_split(np.arange(target.size), min(_N_BLOCKS, target.size))
    counts = np.zeros(terms.shape[1])
    for _ in range(_N_ENSEMBLE):
        rows = np.concatenate([blocks[i] for i in rng.integers(len(blocks), size=len(blocks))])
        matrix, drawn = _compressed(terms[rows], target[rows])
        supports = [(), *_path(matrix, drawn)]
        left = np.array([_remainder(matrix, drawn, support) for support in supports])
        costs = [
            information_criterion(square / rows.size, len(support), independent)
            for square, support in zip(left, supports, strict=True)
        ]
        enough = np.flatnonzero(left <= _CLEARLY**2 * left[int(np.argmin(costs))])[0]
        counts[list(supports[int(enough)])] += 1.0
    return np.asarray(counts / _N_ENSEMBLE)


def supports_by_size(terms: Floats, target: Floats) -> list[Support]:
    """Return the supports that remain when the least useful of terms is dropped again and again, the smallest first."""
    return _path(*_compressed(terms, target))


def information_criterion(mean_square: float, n_terms: int, independent: float) -> float:
    """Return the Bayesian information criterion with the number of independent residuals."""
    return float(independent * np.log(mean_square + 1e-300) + n_terms * np.log(independent))


def _compressed(matrix: Floats, target: Floats) -> tuple[Floats, Floats]:
    """Return a few rows with the same normal equations and the same sum of squares, with columns of unit length."""
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    factor = np.asarray(np.linalg.qr(np.column_stack([matrix / size, target]), mode="r"))
    return factor[:, :-1], factor[:, -1]


def _path(matrix: Floats, target: Floats) -> list[Support]:
    """Return the supports that remain when stepwise sparse regression drops term after term, the smallest first."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from pysindy import SSR
        from sklearn import config_context

        optimizer = SSR(
            alpha=_RIDGE, max_iter=max(1, matrix.shape[1]), criteria="model_residual", unbias=False
        )
        # Each of its hundreds of regressions of a few rows would be examined for longer than it takes.
        with config_context(skip_parameter_validation=True, assume_finite=True):
            optimizer.fit(matrix, target)
    supports = {tuple(map(int, np.flatnonzero(np.ravel(own)))) for own in optimizer.history_}
    return sorted({support for support in supports if support}, key=lambda s: (len(s), s))


def _remainder(matrix: Floats, target: Floats, support: Support) -> float:
    chosen = matrix[:, list(support)]
    left = target - chosen @ np.linalg.lstsq(chosen, target, rcond=1e-10)[0]
    return float(left @ left)
