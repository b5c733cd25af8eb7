"""Covariance of least-squares estimates whose residuals are colored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_DEPENDENT = 1e-14
"""Share of the largest eigenvalue below which a direction of the coordinates moves nothing but rounding errors."""
_TAKES_PART = 1e-9


def colored_covariance(
    sensitivities: Sequence[tuple[NDArray[np.float64], NDArray[np.float64]]], n_common: int
) -> NDArray[np.float64]:
    """Return the covariance of the common coordinates, allowing for colored residuals.

    ``(J^T J)^-1 (sum_f S(f) J(f)^* J(f)^T) (J^T J)^-1`` with the smoothed residual spectrum S of each record. Coordinates that
    the records do not determine get an infinite variance.

    Parameters
    ----------
    sensitivities
        Per record the weighted residuals, shape (n,), and their derivatives, shape (n, n_common + n_own): the first columns
        belong to common coordinates, the others to this record's own (its initial states).
    n_common
        Number of common coordinates.

    Returns
    -------
    Shape (n_common, n_common).

    References
    ----------
    L. Ljung, *System Identification* (Prentice Hall 1999), equation (9.42); W. K. Newey and K. D. West, Econometrica 55
    (1987) 703.
    """
    own_sizes = [derivative.shape[1] - n_common for _, derivative in sensitivities]
    n_total = n_common + sum(own_sizes)
    bread = np.zeros((n_total, n_total))
    filling = np.zeros((n_total, n_total))
    first = n_common
    for (residual, derivative), n_own in zip(sensitivities, own_sizes, strict=True):
        columns = np.concatenate([np.arange(n_common), first + np.arange(n_own)]).astype(np.intp)
        first += n_own
        bread[np.ix_(columns, columns)] += derivative.T @ derivative
        filling[np.ix_(columns, columns)] += _spectral_product(residual, derivative)
    return sandwich_covariance(bread, filling)[:n_common, :n_common]


def sandwich_covariance(bread: NDArray[np.float64], filling: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``bread^-1 filling bread^-1`` with infinite variances of coordinates that the bread does not determine.

    Parameters
    ----------
    bread
        J^T J of the weighted residuals, shape (n, n).
    filling
        Covariance of J^T r, shape (n, n); the bread itself where the residuals are independent with variance 1.

    Returns
    -------
    Shape (n, n).
    """
    if bread.shape[0] == 0:
        return np.zeros((0, 0))
    size = np.sqrt(np.diag(bread))
    size[size == 0.0] = 1.0
    eigenvalues, vectors = np.linalg.eigh(bread / np.outer(size, size))
    seen = eigenvalues > _DEPENDENT * max(float(eigenvalues[-1]), 1e-300)
    known = vectors[:, seen]
    inverse = (known / eigenvalues[seen]) @ known.T
    covariance = inverse @ (filling / np.outer(size, size)) @ inverse / np.outer(size, size)
    # A coordinate that takes part in an unseen direction may be anything, however well its share in the seen ones is known.
    undetermined = np.sum(vectors[:, ~seen] ** 2, axis=1) > _TAKES_PART
    covariance[undetermined, :] = 0.0
    covariance[:, undetermined] = 0.0
    covariance[undetermined, undetermined] = np.inf
    return np.asarray(covariance)


def propagated_covariance(covariance: NDArray[np.float64], chain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return ``chain covariance chain^T`` where variances may be infinite.

    Parameters
    ----------
    covariance
        Of coordinates, shape (n, n), see `colored_covariance`.
    chain
        d parameters / d coordinates, shape (m, n).

    Returns
    -------
    Shape (m, m); a parameter that depends on an undetermined coordinate has an infinite variance, no other is touched.
    """
    infinite = np.isinf(np.diag(covariance))
    finite = np.where(infinite[:, None] | infinite[None, :], 0.0, covariance)
    result = chain @ finite @ chain.T
    touched = np.any(chain[:, infinite] != 0.0, axis=1)
    result[touched, :] = 0.0
    result[:, touched] = 0.0
    result[touched, touched] = np.inf
    return np.asarray(result)


def _spectral_product(residual: NDArray[np.float64], derivative: NDArray[np.float64]) -> NDArray[np.float64]:
    n = residual.size
    power = np.abs(np.fft.rfft(residual)) ** 2 / n
    width = max(5, int(np.sqrt(power.size)))
    smooth = np.convolve(np.pad(power, width, mode="reflect"), np.full(width, 1.0 / width), "same")
    smooth = smooth[width:-width]
    spectra = np.fft.rfft(derivative, axis=0)
    folded = np.full(power.size, 2.0)
    folded[0] = 1.0
    if n % 2 == 0:
        folded[-1] = 1.0
    weighted = spectra * np.sqrt(smooth * folded / n)[:, None]
    return np.asarray(np.real(weighted.conj().T @ weighted))
