"""Eigenvectors come back even where the fast method gives up."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.identify.fit.covariance import symmetric_eigen


@pytest.mark.parametrize("gives_up", [False, True])
def test_the_matrix_is_rebuilt(gives_up: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    root = np.random.default_rng(0).standard_normal((12, 12))
    matrix = root @ root.T
    if gives_up:

        def failing(_: np.ndarray) -> None:
            raise np.linalg.LinAlgError("Eigenvalues did not converge")

        monkeypatch.setattr(np.linalg, "eigh", failing)
    values, vectors = symmetric_eigen(matrix)
    np.testing.assert_allclose((vectors * values) @ vectors.T, matrix, rtol=1e-10, atol=1e-10)
    assert np.all(np.diff(values) >= 0.0)
