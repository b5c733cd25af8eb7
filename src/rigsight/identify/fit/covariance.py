"""Covariance of least-squares estimates whose residuals are colored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.stats import norm, t

from rigsight.records.record import Floats

_ROUNDED_EIGENVALUE = 1e-14
"""Share of the largest eigenvalue below which the effect of a direction of the coordinates is rounding error."""
_MARGIN = 3.0
"""Factor by which the influence of a direction must exceed the error of the derivatives to count as determined; an assumption."""
_MIXED = 30.0
"""The same factor for the component of a coordinate in an undetermined direction, because errors of the derivatives mix
coordinates.

An assumption: ten times the factor for the direction itself, chosen on an arm with three undetermined parameters.
"""
_TAKES_PART = 1e-9
LEVEL = 0.95
"""Probability of all intervals."""
SMOOTHED = 15
"""Lines over which a residual spectrum is averaged. A number of lines, not a share of them: the distance of lines depends on the
duration of the record and not on the sample rate, and the resonance excited by a disturbance is several lines wide."""


def normal_interval(value: float, error: float, level: float = LEVEL) -> tuple[float, float]:
    """Return the confidence interval of an estimate with its standard error."""
    width = float(norm.ppf(0.5 + 0.5 * level)) * error
    return value - width, value + width


def colored_covariance(
    sensitivities: Sequence[tuple[Floats, Floats]],
    n_common: int,
    n_outputs: Sequence[int] | None = None,
    derivative_error: float = 0.0,
    for_intervals: bool = False,
) -> Floats:
    """Return the covariance of the common coordinates, allowing for colored residuals."""
    # ``(J^T J)^-1 (sum_f J(f)^* S(f) J(f)^T) (J^T J)^-1`` with the smoothed residual spectrum S of each record, a matrix over its
    # outputs: a disturbance that acts before two sensors moves both. Coordinates that the records do not determine get an
    # infinite variance.
    # L. Ljung, *System Identification* (Prentice Hall 1999), chapter 9; W. K. Newey and K. D. West, Econometrica 55
    # (1987) 703; F. E. Satterthwaite, Biometrics Bulletin 2 (1946) 110, for the degrees of freedom of a sum.
    own_sizes = [derivative.shape[1] - n_common for _, derivative in sensitivities]
    firsts = n_common + np.cumsum([0, *own_sizes])
    bread = np.zeros((int(firsts[-1]), int(firsts[-1])))
    filling = np.zeros_like(bread)
    stacked = [1] * len(sensitivities) if n_outputs is None else n_outputs
    places = [
        np.concatenate([np.arange(n_common), first + np.arange(size)]).astype(np.intp)
        for first, size in zip(firsts, own_sizes, strict=False)
    ]
    for (residual, derivative), columns, count in zip(sensitivities, places, stacked, strict=True):
        bread[np.ix_(columns, columns)] += derivative.T @ derivative
        filling[np.ix_(columns, columns)] += spectral_product(residual, derivative, count)
    covariance = sandwich_covariance(bread, filling, derivative_error)[:n_common, :n_common]
    if for_intervals and n_common:
        inverse = sandwich_covariance(bread, bread, derivative_error)[:, :n_common]
        inverse = np.where(np.isfinite(inverse), inverse, 0.0)
        reads = [
            (residual, derivative @ inverse[place], count)
            for (residual, derivative), place, count in zip(sensitivities, places, stacked, strict=True)
        ]
        widened = np.sqrt(_interval_factors(reads))
        covariance = covariance * np.outer(widened, widened)
    return np.asarray(covariance)


def _interval_factors(reads: Sequence[tuple[Floats, Floats, int]]) -> Floats:
    """Return the factors on variances for the few degrees of freedom of the noise, shape (n,)."""
    # Each of the records has its residuals, the weights with which the estimates read them, and the number of its outputs.
    size, spread = 0.0, 0.0
    for residual, weights, count in reads:
        by_output = residual.reshape(count, -1)
        n = by_output.shape[1]
        for own, read in zip(by_output, weights.reshape(count, n, -1), strict=True):
            noise = smoothed_spectrum(np.abs(np.fft.rfft(own)) ** 2 + 0j).real
            # A variance is a sum over lines, each of which counts with the weights of its neighbors too.
            powers = np.abs(np.fft.rfft(read, axis=0)) ** 2
            width = min(SMOOTHED, 2 * powers.shape[0] - 1)
            shares = noise[:, None] * uniform_filter1d(powers, width, axis=0, mode="mirror")
            # Lines above zero stand for those below it as well; the line at zero has one degree of freedom, the others two.
            shares[1:] *= 2.0
            size = size + np.sum(shares, axis=0)
            spread = spread + 2.0 * shares[0] ** 2 + np.sum(shares[1:] ** 2, axis=0)
    freedom = 2.0 * size**2 / np.maximum(spread, np.finfo(np.float64).tiny)
    # The estimate itself took one.
    remainder = np.maximum(freedom - 1.0, 1.0)
    quantile = 0.5 + 0.5 * LEVEL
    return np.asarray((remainder + 1.0) / remainder * (t.ppf(quantile, remainder) / norm.ppf(quantile)) ** 2)


def sandwich_covariance(bread: Floats, filling: Floats, derivative_error: float = 0.0) -> Floats:
    """Return ``bread^-1 filling bread^-1``, shape (n, n), with infinite variances for what the bread does not determine.

    The bread is J^T J of the weighted residuals, with a relative error of the derivatives. The filling is the covariance of
    J^T r; it equals the bread if the residuals are independent with variance 1.
    """
    if bread.shape[0] == 0:
        return np.zeros((0, 0))
    size = np.sqrt(np.diag(bread))
    size[size == 0.0] = 1.0
    eigenvalues, vectors = symmetric_eigen(bread / np.outer(size, size))
    dependent = max(_ROUNDED_EIGENVALUE, (_MARGIN * derivative_error) ** 2)
    seen = eigenvalues > dependent * max(float(eigenvalues[-1]), 1e-300)
    known = vectors[:, seen]
    inverse = (known / eigenvalues[seen]) @ known.T
    covariance = inverse @ (filling / np.outer(size, size)) @ inverse / np.outer(size, size)
    # A coordinate with a component in an undetermined direction is undetermined, however well its other components are known.
    takes_part = max(_TAKES_PART, (_MIXED * derivative_error) ** 2)
    undetermined = np.sum(vectors[:, ~seen] ** 2, axis=1) > takes_part
    covariance[undetermined, :] = 0.0
    covariance[:, undetermined] = 0.0
    covariance[undetermined, undetermined] = np.inf
    return np.asarray(covariance)


def propagated_covariance(covariance: Floats, chain: Floats) -> Floats:
    """Return ``chain covariance chain^T``, for variances that may be infinite."""
    infinite = np.isinf(np.diag(covariance))
    finite = np.where(infinite[:, None] | infinite[None, :], 0.0, covariance)
    result = chain @ finite @ chain.T
    touched = np.any(chain[:, infinite] != 0.0, axis=1)
    result[touched, :] = 0.0
    result[:, touched] = 0.0
    result[touched, touched] = np.inf
    return np.asarray(result)


def spectral_product(residual: Floats, derivative: Floats, count: int) -> Floats:
    """Return the covariance of J^T r of one record from the smoothed spectrum of its residual, shape (n, n).

    Residuals and derivatives are those of `count` outputs, one after the other: (count * n_samples,) and (count * n_samples, n).
    """
    by_output = residual.reshape(count, -1)
    n = by_output.shape[1]
    lines = np.fft.rfft(by_output, axis=1)
    spectra = np.fft.rfft(derivative.reshape(count, n, -1), axis=1)
    folded = np.full(lines.shape[1], 2.0)
    folded[0] = 1.0
    if n % 2 == 0:
        folded[-1] = 1.0
    product = np.zeros((derivative.shape[1], derivative.shape[1]))
    for one in range(count):
        for other in range(count):
            power = smoothed_spectrum(lines[one] * lines[other].conj() / n) * (folded / n)
            product += np.real((spectra[one].conj() * power[:, None]).T @ spectra[other])
    return np.asarray(product)


def smoothed_spectrum(spectrum: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Average over neighbors; beyond zero and Nyquist the spectrum of a real signal is continued by its conjugate."""
    half = min(SMOOTHED // 2, spectrum.size - 1)
    before, after = spectrum[half:0:-1].conj(), spectrum[-2 : -2 - half : -1].conj()
    around = np.concatenate([before, spectrum, after])
    return np.asarray(np.convolve(around, np.full(2 * half + 1, 1.0 / (2 * half + 1)), "valid"))


def mean_square_freedom(residual: Floats) -> float:
    """Return the degrees of freedom of the mean square of a colored residual, shape (n_samples,).

    F. E. Satterthwaite, Biometrics Bulletin 2 (1946) 110: those of a chi-squared variable with the same relative variance.
    """
    power = smoothed_spectrum(np.abs(np.fft.fft(residual)) ** 2 + 0j).real
    squares = float(np.sum(power**2))
    return max(1.0, float(np.sum(power)) ** 2 / squares) if squares > 0.0 else float(residual.size)


def symmetric_eigen(matrix: Floats) -> tuple[Floats, Floats]:
    """Return eigenvalues in ascending order, shape (n,), and eigenvectors as columns, shape (n, n)."""
    # Divide and conquer is faster but has failed on a well-conditioned matrix of 90 rows; relatively robust representations are
    # used then.
    try:
        values, vectors = np.linalg.eigh(matrix)
    except np.linalg.LinAlgError:
        values, vectors = scipy.linalg.eigh(matrix, driver="evr")
    return values, vectors
