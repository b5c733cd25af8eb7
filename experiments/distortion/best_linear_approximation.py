"""Linear part, noise and nonlinear distortion of a periodic response.

The best linear approximation of a nonlinear system depends on the power spectrum of the excitation, not on its phases.
Differences between periods are noise; differences only between realisations of the random phases are distortion.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 3 and 4. J.
Schoukens, M. Vaes and R. Pintelon, "Linear system identification in a nonlinear setting", IEEE Control Systems Magazine
(2016).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import check_alike, hold_response, line_frequencies, pair_unit
from rigsight.records.record import Hold, Record

_EXCITED = 1e-6
"""Power of a line of the source, relative to its strongest, above which the line counts as excited: -60 dB."""


@dataclass(frozen=True, eq=False)
class BestLinearApproximation:
    """A best linear approximation and the deviation of the system from it.

    Attributes
    ----------
    response
        The approximation at the excited lines, with its total and its noise variance.
    distortion
        Variance of the values of ONE realisation due to nonlinear distortion, in the square of the response's unit,
        shape (n_frequencies,). Zero where noise masks it.
    n_realisations, n_periods
        Number of realisations, and of periods of each.
    """

    response: FrequencyResponse
    distortion: NDArray[np.float64]
    n_realisations: int
    n_periods: int


@dataclass(frozen=True, eq=False)
class DetectedDistortion:
    """A response at the excited lines and the levels of the response signal between them.

    Levels are mean squares of complex line amplitudes (a sine of amplitude 1 has level 1) in the square of the response
    signal's unit. The noise level is subtracted from the distortion levels, which may therefore scatter below zero.

    Attributes
    ----------
    response
        The response at the excited lines. Its variance includes the distortion at the neighboring odd detection lines; its
        noise variance is that of the periods.
    odd_omega, odd_level
        Detection lines at odd multiples of the fundamental and the level there, shape (n_odd,).
    even_omega, even_level
        Detection lines at even multiples and the level there, shape (n_even,).
    noise_level
        Noise level at the excited lines, of the mean over all periods, shape (n_frequencies,).
    n_periods
        Number of periods.
    """

    response: FrequencyResponse
    odd_omega: NDArray[np.float64]
    odd_level: NDArray[np.float64]
    even_omega: NDArray[np.float64]
    even_level: NDArray[np.float64]
    noise_level: NDArray[np.float64]
    n_periods: int


@dataclass(frozen=True, eq=False)
class _Periods:
    """Line amplitudes over the periods of one record, without the line at zero."""

    omega: NDArray[np.float64]
    U: NDArray[np.complex128]
    Y: NDArray[np.complex128]
    source_noise: NDArray[np.float64]
    response_noise: NDArray[np.float64]
    cross_noise: NDArray[np.complex128]
    n_periods: int


def robust_best_linear_approximation(
    records: Sequence[Record],
    source: str,
    response: str,
    n_per_period: int,
    *,
    skipped_periods: int = 1,
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
) -> BestLinearApproximation:
    """Return the best linear approximation from several realisations of a random-phase multisine.

    Parameters
    ----------
    records
        One record per realisation, at least two; all of the same lines and amplitudes.
    source, response
        Names of the signals.
    n_per_period
        Samples in one period.
    skipped_periods
        Periods left out at the beginning of each record, because they contain the transient.
    hold
        Hold of the source between its samples (see `hold_response`).
    band
        Limits [rad/s]; None takes all excited lines.

    Raises
    ------
    InputError
        If there are fewer than two realisations or two periods, or no excited line lies in the band.

    Notes
    -----
    The total variance comes from the scatter of the realisations, the noise variance from that of the periods; the
    distortion is their difference, times the number of realisations. Variances from few repetitions are uncertain: their
    ratio has ``2 (M - 1)`` and ``2 M (P - 1)`` degrees of freedom, with M realisations of P periods.
    """
    check_alike(records, source, response)
    if len(records) < 2:
        raise InputError(
            "The robust method needs at least two realisations, each in its own record, got one: record another with new "
            "random phases, or use detection lines."
        )
    realisations = [_periods(record, source, response, n_per_period, skipped_periods) for record in records]
    power = np.mean([np.abs(p.U) ** 2 for p in realisations], axis=0)
    lines = _excited_lines(realisations[0].omega, power, band, records[0].name, source)
    omega = realisations[0].omega[lines]
    held = hold_response(omega, records[0].dt, hold)
    each = np.array([p.Y[lines] / p.U[lines] for p in realisations]) / held
    count = len(records)
    noise = np.mean([_noise_variance(p, lines) for p in realisations], axis=0) / np.abs(held) ** 2 / count
    total = np.var(each, axis=0, ddof=1) / count
    return BestLinearApproximation(
        response=FrequencyResponse(
            omega=omega,
            values=np.mean(each, axis=0),
            source=source,
            response=response,
            unit=pair_unit(records[0], source, response),
            variance=total,
            noise_variance=noise,
            records=tuple(record.name for record in records),
            method=f"best linear approximation, {count} realisations of {realisations[0].n_periods} periods",
        ),
        distortion=np.maximum(total - noise, 0.0) * count,
        n_realisations=count,
        n_periods=realisations[0].n_periods,
    )


def fast_best_linear_approximation(
    record: Record,
    source: str,
    response: str,
    n_per_period: int,
    *,
    skipped_periods: int = 1,
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
) -> DetectedDistortion:
    """Return response, noise and distortion from one multisine with detection lines.

    Parameters
    ----------
    record
        At least two periods of a random-phase multisine that excites odd lines and leaves some of them out.
    source, response
        Names of the signals.
    n_per_period
        Samples in one period.
    skipped_periods
        Periods left out at the beginning, because they contain the transient.
    hold
        Hold of the source between its samples (see `hold_response`).
    band
        Limits [rad/s]; None takes all from the first to the last excited line.

    Raises
    ------
    InputError
        If there are fewer than two periods, no excited line lies in the band, an even line is excited, or no odd line was
        left out.

    Notes
    -----
    The source's own content at a detection line, such as an amplifier's distortion, is removed with the response
    interpolated from the neighboring excited lines.
    """
    check_alike([record], source, response)
    periods = _periods(record, source, response, n_per_period, skipped_periods)
    lines = _excited_lines(periods.omega, np.abs(periods.U) ** 2, band, record.name, source)
    numbers = lines + 1
    if (numbers % 2 == 0).any():
        raise InputError(
            f"Record '{record.name}': '{source}' excites even lines, such as {periods.omega[lines[numbers % 2 == 0][0]]:.4g} "
            "rad/s, where even distortion should show: excite odd lines only, or use the robust method."
        )
    silent = np.setdiff1d(np.arange(lines[0], lines[-1] + 1), lines)
    odd, even = silent[silent % 2 == 0], silent[silent % 2 == 1]
    if odd.size == 0:
        raise InputError(
            f"Record '{record.name}': '{source}' leaves out no odd line in the band, so odd distortion cannot be distinguished "
            f"from the response: use an odd multisine with random detection lines."
        )
    omega = periods.omega
    sampled = periods.Y[lines] / periods.U[lines]
    leaked = np.interp(omega, omega[lines], sampled.real) + 1j * np.interp(omega, omega[lines], sampled.imag)
    level = np.abs(periods.Y - leaked * periods.U) ** 2 - periods.response_noise
    held = hold_response(omega[lines], record.dt, hold)
    noise = _noise_variance(periods, lines) / np.abs(held) ** 2
    around = np.interp(omega[lines], omega[odd], _smoothed(np.maximum(level[odd], 0.0)))
    distortion = around / np.abs(periods.U[lines] * held) ** 2
    return DetectedDistortion(
        response=FrequencyResponse(
            omega=omega[lines],
            values=sampled / held,
            source=source,
            response=response,
            unit=pair_unit(record, source, response),
            variance=noise + distortion,
            noise_variance=noise,
            records=(record.name,),
            method=f"best linear approximation, detection lines, {periods.n_periods} periods",
        ),
        odd_omega=omega[odd],
        odd_level=level[odd],
        even_omega=omega[even],
        even_level=level[even],
        noise_level=periods.response_noise[lines],
        n_periods=periods.n_periods,
    )


def _periods(record: Record, source: str, response: str, n_per_period: int, skipped: int) -> _Periods:
    if n_per_period < 4 or skipped < 0:
        raise InputError(
            f"A period must have at least 4 samples and skipped_periods be 0 or more, got {n_per_period} and {skipped}."
        )
    count = record.n_samples // n_per_period - skipped
    if count < 2:
        raise InputError(
            f"Record '{record.name}' has {record.n_samples} samples; {skipped} skipped and two used periods of "
            f"{n_per_period} need {(skipped + 2) * n_per_period}: record longer, or choose a shorter period."
        )
    omega = line_frequencies(n_per_period, record.dt)

    def lines_of(signal: str) -> NDArray[np.complex128]:
        rows = record[signal][skipped * n_per_period : (skipped + count) * n_per_period]
        spectra = np.fft.rfft(rows.reshape(count, n_per_period), axis=1)
        return np.asarray(2.0 / n_per_period * spectra[:, 1 : omega.size + 1])

    U, Y = lines_of(source), lines_of(response)
    mean_U, mean_Y = U.mean(axis=0), Y.mean(axis=0)
    cross = np.sum((Y - mean_Y) * (U - mean_U).conj(), axis=0) / (count - 1)
    return _Periods(
        omega=omega,
        U=mean_U,
        Y=mean_Y,
        source_noise=np.var(U, axis=0, ddof=1) / count,
        response_noise=np.var(Y, axis=0, ddof=1) / count,
        cross_noise=np.asarray(cross / count),
        n_periods=count,
    )


def _noise_variance(periods: _Periods, lines: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the variance of the ratio of the signals due to the noise of both, to first order."""
    U, Y = periods.U[lines], periods.Y[lines]
    ratio = Y / U
    variance = (
        periods.response_noise[lines]
        + np.abs(ratio) ** 2 * periods.source_noise[lines]
        - 2.0 * np.real(ratio.conj() * periods.cross_noise[lines])
    )
    return np.asarray(np.maximum(variance, 0.0) / np.abs(U) ** 2)


def _excited_lines(
    omega: NDArray[np.float64],
    power: NDArray[np.float64],
    band: tuple[float, float] | None,
    name: str,
    source: str,
) -> NDArray[np.intp]:
    lower, upper = (0.0, np.inf) if band is None else band
    strongest = power.max()
    if strongest == 0.0:
        raise InputError(f"Record '{name}': '{source}' is constant: without excitation there is no response.")
    excited = power > _EXCITED * strongest
    lines = np.flatnonzero(excited & (omega >= lower) & (omega <= upper))
    if lines.size == 0:
        raise InputError(
            f"Record '{name}': '{source}' excites no line from {lower:g} to {upper:g} rad/s; it excites "
            f"{omega[excited][0]:.4g} to {omega[excited][-1]:.4g} rad/s."
        )
    return lines


def _smoothed(level: NDArray[np.float64], width: int = 5) -> NDArray[np.float64]:
    """Return the mean over neighbors: the level of one line has an exponential distribution."""
    weights = np.ones(min(width, level.size))
    return np.asarray(
        np.convolve(level, weights, mode="same") / np.convolve(np.ones(level.size), weights, mode="same")
    )
