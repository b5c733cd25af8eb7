"""Eigenvalues and eigenvectors of a symmetric matrix, also if LAPACK's divide and conquer fails."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import NDArray


def symmetric_eigen(matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return eigenvalues in ascending order, shape (n,), and eigenvectors as columns, shape (n, n).

    Divide and conquer is faster but has failed on a well-conditioned matrix of 90 rows; relatively robust representations are
    used then.
    """
    try:
        values, vectors = np.linalg.eigh(matrix)
    except np.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(matrix, driver="evr")
    return values, vectors
