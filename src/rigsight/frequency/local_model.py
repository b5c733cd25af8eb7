"""Frequency response from one record without periods: local polynomial and local rational models.

In a narrow band the response and the transient (from the difference between initial and final state of the record, which a window
only smears) are both smooth functions of frequency, while the spectrum of the source is rough. Both are fitted there by least
squares; the residual is the noise.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 7. R. Pintelon, J.
Schoukens, G. Vandersteen and K. Barbe, "Estimation of nonparametric noise and FRF models for multivariable systems", Mech.
Syst. Signal Process. (2010). T. McKelvey and G. Guerin, "Non-parametric frequency response estimation using a local rational
model", 16th IFAC Symposium on System Identification (2012).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rigsight.errors import InputError
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import (
    among,
    check_resolution,
    excited,
    hold_response,
    line_frequencies,
    pair_unit,
)
from rigsight.records.record import Floats, Hold, Record

SPARE = 6
"""Equations in excess of the unknowns in the narrowest automatic band: with fewer, the variance is unreliable."""
_CHUNK = 4096
_RANK = 1e-11
"""Relative singular value below which two terms of a local model are the same."""
_RESPONDS = 10.0
"""Power over variance (10 dB) required of the source's response to an instrument, at lines with half of the instrument's power;
by chance one line in 500 reaches it."""


@dataclass(frozen=True)
class _LocalModel:
    """Lines on each side of the center, degrees of polynomials and denominator, and whether a transient is modeled."""

    half: int
    order: int
    poles: int
    transient: bool

    @property
    def width(self) -> int:
        return 2 * self.half + 1


def local_response(
    record: Record,
    source: str,
    response: str,
    *,
    order: int = 2,
    poles: int = 0,
    bandwidth: float | None = None,
    transient: bool = True,
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
    wanted: Floats | None = None,
    instrument: str | None = None,
) -> FrequencyResponse:
    """Return the frequency response with a function of the frequency fitted around each line.

    ``A(r) Y(k + r) = B(r) U(k + r) + T(r)`` with polynomials ``B`` and ``T`` of degree `order`, ``A`` of degree `poles` and
    ``A(0) = 1``. With poles a resonance narrower than the band is followed, where a polynomial cuts its peak.

    Parameters
    ----------
    record
        One record; it need not be periodic, nor begin or end at rest.
    source, response
        Names of the signals.
    order
        Degree of the numerators.
    poles
        Degree of the common denominator; 0 for a polynomial.
    bandwidth
        Width of the band around each line [rad/s]; None takes the narrowest that leaves six degrees of freedom. Wider
        bands lower the variance and raise the bias.
    transient
        False for a record that begins and ends at rest: fewer unknowns, and a better estimate at the slow beginning of a sweep.
    hold
        Hold of the source between its samples: the default for a measured source, the record's hold for a commanded input
        (see `hold_response`).
    band
        Limits [rad/s]; None takes all that the source excites.
    wanted
        Required frequencies [rad/s], ascending: other lines are skipped. None takes all of the band.
    instrument
        A signal that drives source and response from outside, free of their noise: the reference of a closed loop. The response
        is then the ratio of their responses to it, which noise on the source, fed back or not, does not bias.

    Returns
    -------
    FrequencyResponse
        At every line of the record's spectrum in the band. Neighbors share data, so their errors are correlated over
        `bandwidth` (see `FrequencyResponse.noise_shares`). The variance includes the bias, which is the difference from a local
        rational model beyond the noise of both.

    Raises
    ------
    InputError
        If the record is too short for `bandwidth`, or does not excite the band, or the source is not correlated with the
        instrument.

    Notes
    -----
    A sweep that begins with the record has, at its first frequencies, a spectrum as smooth as a transient's; the two cannot
    be distinguished there and the variance is large. Some seconds of rest before the sweep avoid this. With rest after it as
    well, ``transient=False`` is better still; without rest it is biased, and its variance does not show the bias.

    With poles the response is on both sides of the equation, so large noise biases the estimate: below a signal-to-noise ratio of
    about 30 dB the variance is 10 to 30 % too small, and below 20 dB the polynomial is better. Where the beginning of a sweep and
    the transient cannot be distinguished, the variance may be several times too small.
    """
    method = "local rational" if poles else "local polynomial"
    if order < 0:
        raise InputError(f"The order of a local model must be 0 or more, got {order}.")
    what = f"Record '{record.name}'"
    span = record.n_samples * record.dt
    unknowns = (2 if transient else 1) * (order + 1) + poles
    narrowest = unknowns + SPARE
    if bandwidth is None:
        bandwidth = 2.0 * math.pi / span * narrowest
    # A variance needs at least one degree of freedom.
    check_resolution(bandwidth, span, unknowns + 1, f"{what}, for a {method} model of order {order},")
    half = max(round(bandwidth * span / (4.0 * math.pi)), (unknowns + 1) // 2)
    omega = line_frequencies(record.n_samples, record.dt)
    U, Y = (np.fft.rfft(record[name])[1 : omega.size + 1] for name in (source, response))
    model = _LocalModel(half, order, poles, transient)
    width = model.width
    if width > U.size:
        raise InputError(
            f"{what} has {U.size} spectral lines, fewer than the {width} of one local band: record more samples."
        )
    driven_by, drive = ("source", source) if instrument is None else ("instrument", instrument)
    R = U if instrument is None else np.fft.rfft(record[instrument])[1 : omega.size + 1]
    smoothed = np.convolve(np.abs(R) ** 2, np.ones(width) / width, mode="same")
    lines = np.flatnonzero(excited(omega, smoothed, band, f"{what}: the {driven_by} '{drive}'"))
    kept = np.ones(lines.size, dtype=np.bool_) if wanted is None else among(omega[lines], wanted)
    if not kept.any():
        raise InputError(f"{what} does not excite any of the requested frequencies.")
    if poles:
        # The bias of a polynomial is smoothed over its neighbors, so it needs all lines.
        lines, kept = lines[kept], kept[kept]
    chunks = [lines[start : start + _CHUNK] for start in range(0, lines.size, _CHUNK)]
    if instrument is None:
        parts = [_solve(U, Y, chunk, model) for chunk in chunks]
    else:
        ratios = [_solve_ratio(R, U, Y, chunk, model) for chunk in chunks]
        responds = np.concatenate([clearness for *_, clearness in ratios]) >= _RESPONDS
        power = np.abs(R[lines]) ** 2
        if power @ responds < 0.5 * np.sum(power):
            raise InputError(
                f"{what}: the source '{source}' is not correlated with the instrument '{instrument}'."
            )
        parts = [ratio[:4] for ratio in ratios]
        method = f"{method} by {instrument}"
    values, shares, near, noise = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    held = hold_response(omega[lines], record.dt, hold)
    shares = np.asarray(shares / held[:, None])
    variance = np.sum(np.abs(shares) ** 2, axis=1)
    bias = None
    rational = replace(model, half=half + order, poles=max(order, 1))
    if not poles and instrument is None and rational.width <= U.size:
        parts = [_solve(U, Y, chunk, rational) for chunk in chunks]
        near_values, near_shares = (np.concatenate(arrays) for arrays in list(zip(*parts, strict=True))[:2])
        noisy = variance + np.sum(np.abs(near_shares / held[:, None]) ** 2, axis=1)
        # One difference may exceed its noise by chance; the mean over a band of them hardly does.
        excess = np.abs((near_values - values) / held) ** 2 - noisy
        bias = np.sqrt(np.maximum(uniform_filter1d(excess, width, mode="nearest"), 0.0))
    return FrequencyResponse(
        omega=omega[lines],
        values=values / held,
        source=source,
        response=response,
        unit=pair_unit(record, source, response),
        variance=variance if bias is None else variance + bias**2,
        records=(record.name,),
        method=f"{method}, order {order}, {width} lines",
        noise_shares=shares,
        noise_lines=near,
        line_noise=noise,
        bias=bias,
        noise_freedom=float(width - unknowns),
    ).at(kept)


local_polynomial_response = partial(local_response, poles=0)
local_rational_response = partial(local_response, poles=2)


class LocalFit:
    """Least squares in many local bands at once; linearly dependent terms share a coefficient.

    Terms have the shape (n_bands, n_equations, n_terms), the right-hand sides (n_bands, n_equations). `absorbed` equations do not
    count, one number for all bands or of shape (n_bands,): as many as terms were projected out of both before, and those that
    are zero because a record has no such frequency.
    """

    def __init__(
        self,
        terms: NDArray[np.complex128],
        sides: NDArray[np.complex128],
        absorbed: int | NDArray[np.intp] = 0,
    ) -> None:
        scales = np.linalg.norm(terms, axis=1, keepdims=True)
        scales[scales == 0.0] = 1.0
        left, singular, right = np.linalg.svd(terms / scales, full_matrices=False)
        kept = singular > _RANK * singular[:, :1]
        inverse = np.where(kept, 1.0 / np.where(kept, singular, 1.0), 0.0)
        projected = np.einsum("lws,lw->ls", left.conj(), sides)
        theta = np.einsum("lsp,ls->lp", right.conj(), inverse * projected)
        residual = sides - np.einsum("lwp,lp->lw", terms / scales, theta)
        # Shape (n_bands,) each: degrees of freedom, sum of squares of the residual, and the same per degree of freedom.
        self.freedom = terms.shape[1] - absorbed - np.count_nonzero(kept, axis=1)
        self.left_over = np.sum(np.abs(residual) ** 2, axis=1)
        self.noise = self.left_over / self.freedom
        self._residual = residual
        self._scales, self._theta = scales[:, 0], theta
        self._left, self._inverse, self._right = left, inverse, right

    def coefficient(self, term: int) -> NDArray[np.complex128]:
        """Return the coefficient of one term, shape (n_bands,)."""
        return np.asarray(self._theta[:, term] / self._scales[:, term])

    def noise_with(self, other: LocalFit) -> NDArray[np.complex128]:
        """Return the residuals' covariance with another fit in the same bands, per degree of freedom, shape (n_bands,)."""
        return np.asarray(np.sum(self._residual * other._residual.conj(), axis=1) / self.freedom)

    def shares(self, term: int) -> NDArray[np.complex128]:
        """Return the weight of each equation in the coefficient of one term, shape (n_bands, n_equations)."""
        rows = np.einsum("ls,lws->lw", self._right[:, :, term].conj() * self._inverse, self._left.conj())
        return np.asarray(rows / self._scales[:, term, None])


def _solve(
    U: NDArray[np.complex128], Y: NDArray[np.complex128], lines: NDArray[np.intp], model: _LocalModel
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.intp], Floats]:
    """Return the values at some lines, the shares of the noise in them, the lines that this noise is from, and its power."""
    fit, picked = _fit(U, Y, lines, model)
    return fit.coefficient(0), fit.shares(0) * np.sqrt(fit.noise)[:, None], picked, fit.noise


def _solve_ratio(
    R: NDArray[np.complex128],
    U: NDArray[np.complex128],
    Y: NDArray[np.complex128],
    lines: NDArray[np.intp],
    model: _LocalModel,
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.intp], Floats, Floats]:
    """Return the results of `_solve` for the ratio of the responses of Y and U to R, and the power of U's over its variance."""
    # The noise of a line in both signals is treated as one noise, with the phase that it has in Y: noise that feedback brings
    # into both cancels, as it does in the ratio.
    (below, picked), (above, _) = (_fit(R, S, lines, model) for S in (U, Y))
    denominator = below.coefficient(0)
    # A denominator that is zero by chance is no error: its value gets no weight.
    denominator = np.where(denominator == 0.0, np.finfo(np.float64).tiny, denominator)
    values = above.coefficient(0) / denominator
    of_Y, of_U = above.shares(0), values[:, None] * below.shares(0)
    variance = (
        np.abs(of_Y) ** 2 * above.noise[:, None]
        + np.abs(of_U) ** 2 * below.noise[:, None]
        - 2.0 * np.real(of_Y * of_U.conj() * above.noise_with(below)[:, None])
    )
    shares = np.sqrt(np.maximum(variance, 0.0)) * np.exp(1j * np.angle(of_Y)) / denominator[:, None]
    unsure = np.sum(np.abs(below.shares(0)) ** 2, axis=1) * below.noise
    clearness = np.abs(denominator) ** 2 / np.maximum(unsure, np.finfo(np.float64).tiny)
    return values, shares, picked, above.noise, clearness


def _fit(
    U: NDArray[np.complex128],
    Y: NDArray[np.complex128],
    lines: NDArray[np.intp],
    model: _LocalModel,
) -> tuple[LocalFit, NDArray[np.intp]]:
    """Return the local models around some lines, and the lines of each; at the ends of the spectrum a band is one-sided."""
    first = np.clip(lines - model.half, 0, U.size - model.width)
    picked = first[:, None] + np.arange(model.width)
    r = (picked - lines[:, None]) / model.half
    powers = r[..., None] ** np.arange(model.order + 1)
    near_U, near_Y = U[picked][..., None], Y[picked][..., None]
    terms = [powers * near_U]
    if model.transient:
        terms.append(powers.astype(np.complex128))
    if model.poles:
        terms.append(-(r[..., None] ** np.arange(1, model.poles + 1)) * near_Y)
    return LocalFit(np.concatenate(terms, axis=-1), near_Y[..., 0]), picked
