"""Frequency response from spectra: averaged over overlapping segments (H1, H2, Hv), or the plain ratio line by line.

The plain ratio has the free motion of the record in it; or it is made as in the thesis, sections 4.2 and 4.3: FFT of the response
over FFT of the source, cut, ``unwrap``, phase "adjusted".

References
----------
J. S. Bendat and A. G. Piersol, *Random Data* (Wiley 2010), chapters 6 and 9. G. T. Rocklin, J. Crowley and H. Vold, "A
comparison of H1, H2 and Hv frequency response functions", Proc. IMAC (1985). P. D. Welch, IEEE Trans. Audio and
Electroacoustics 15 (1967) 70.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from rigsight.errors import InputError, check_option
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import (
    check_alike,
    check_resolution,
    excited,
    hold_response,
    line_frequencies,
    pair_unit,
)
from rigsight.records.record import Floats, Hold, Record

Estimator = Literal["H1", "H2", "Hv"]
_SMOOTHED = 15
"""Lines over which the noise of local bands is averaged: one more band to each side, far less than a resonance is wide."""
_ENDS = 15
"""Points at either end whose mean phase the thesis takes as the phase reached there."""


def averaged_response(
    records: Record | Sequence[Record],
    source: str,
    response: str,
    resolution: float,
    *,
    estimator: Estimator = "H1",
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Return the frequency response from cross and auto spectra averaged over Hann windows that overlap by half.

    Parameters
    ----------
    records
        One record, or several of one sample time whose segments are averaged together.
    source, response
        Names of the signals.
    resolution
        Distance of the frequencies [rad/s]; a segment has a length of 2 pi / resolution.
    estimator
        ``"H1"`` is unbiased for noise on the response, ``"H2"`` for noise on the source, ``"Hv"`` for the same relative
        noise on both; it is the geometric mean of the other two.
    hold
        Hold of the source between its samples: the default for a measured source, the record's hold for a commanded input
        (see `hold_response`).
    band
        Limits [rad/s]; None takes all that the source excites.

    Returns
    -------
    FrequencyResponse
        With coherence, and the variance that follows from it.

    Raises
    ------
    InputError
        If the records are too short for two segments, differ in sample time, or do not excite the band.

    Notes
    -----
    The variance includes everything that is not coherent: noise, nonlinear distortion, and the leakage of a source that is
    not stationary. It does not include the bias due to leakage, which widens and lowers a lightly damped peak;
    `local_rational_response` is nearly free of this bias.
    """
    several = [records] if isinstance(records, Record) else list(records)
    check_alike(several, source, response)
    check_option("The estimator", estimator, get_args(Estimator))
    dt = several[0].dt
    shortest = min(several, key=lambda record: record.n_samples)
    what = f"Record '{shortest.name}'"
    check_resolution(resolution, shortest.n_samples * dt, 1.0, what)
    length = round(2.0 * math.pi / (resolution * dt))
    step = length - length // 2
    counts = np.array([1 + (record.n_samples - length) // step for record in several])
    if counts.sum() < 2:
        raise InputError(
            f"{what} holds one segment of {length * dt:.4g} s, and a single segment has no coherence: allow a resolution of "
            f"{2.0 * resolution:.4g} rad/s, or give more records."
        )
    weights = scipy.signal.get_window("hann", length)
    omega = line_frequencies(length, dt)
    spectra = _spectra(several, source, response, weights, length - step, counts)[:, 1 : omega.size + 1]
    kept = excited(omega, spectra[0].real, band, f"{what}: the source '{source}'")
    omega, cross = omega[kept], spectra[2, kept]
    power_source, power_response = spectra[0, kept].real, spectra[1, kept].real
    if not (np.abs(cross) > 0.0).all():
        raise InputError(f"{what}: the response '{response}' does not respond to '{source}'.")
    coherence = np.minimum(np.abs(cross) ** 2 / (power_source * power_response), 1.0)
    values = cross / power_source
    if estimator != "H1":
        values = values / (coherence if estimator == "H2" else np.sqrt(coherence))
    averages = _independent(weights, step, float(counts.sum()))
    relative = (1.0 - coherence) / coherence / max(averages - 1.0, 1.0)
    held = hold_response(omega, dt, hold)
    return FrequencyResponse(
        omega=omega,
        values=values / held,
        source=source,
        response=response,
        unit=pair_unit(several[0], source, response),
        variance=relative * np.abs(values / held) ** 2,
        coherence=coherence,
        records=tuple(record.name for record in several),
        method=f"{estimator}, hann window, {int(counts.sum())} segments of {length * dt:.4g} s",
    )


def _spectra(
    records: Sequence[Record],
    source: str,
    response: str,
    window: Floats,
    overlapping: int,
    counts: NDArray[np.int_],
) -> NDArray[np.complex128]:
    """Return the power of source and response and their cross spectrum over all segments, shape (3, n_lines)."""
    # scipy's stubs know neither samples of a window nor the default of detrend.
    csd: Any = functools.partial(scipy.signal.csd, window=window, noverlap=overlapping, detrend="constant")
    pairs = ((source, source), (response, response), (source, response))
    spectra = [[csd(r[a], r[b], 1.0 / r.dt)[1] for a, b in pairs] for r in records]
    return np.asarray(np.average(spectra, axis=0, weights=counts), dtype=np.complex128)


def _independent(window: Floats, step: int, n_segments: float) -> float:
    """Return the number of independent segments with the variance of the overlapping ones; Welch's formula."""
    power = float(window @ window)
    shared = 0.0
    for shift in range(step, window.size, step):
        correlation = float(window[shift:] @ window[:-shift]) / power
        shared += 2.0 * (1.0 - shift / step / n_segments) * correlation**2
    return n_segments / (1.0 + max(shared, 0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class PlainRatio(FrequencyResponse):
    """Response over source at each line of a record, with independent errors.

    It is ``G + T / drive`` with the free motion T that the difference between the first and the last state of the record excites.
    A local model confuses T with the response at lines that a smooth sweep visits near the ends of a record: both are smooth
    there. T has the poles of G, so a form of G distinguishes them.
    """

    drive: NDArray[np.complex128]  # spectrum of the source with its hold, shape (n_frequencies,)
    # Sample time [s] and length of the record, and the hold of the source.
    dt: float
    n_samples: int
    hold: Hold

    def free_motions(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return a basis of the free motions with poles [1/s] over the drive, shape (n_frequencies, n_poles)."""
        return np.asarray(_free_motions(self.omega, self.dt, poles) / self.drive[:, None])

    def free_motion(self, weights: Floats, poles: NDArray[np.complex128]) -> Floats:
        """Return the free motion with these weights of the basis over time, without its mean, shape (n_samples,)."""
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(self.n_samples, self.dt)[1:], dtype=np.float64)
        lines = _free_motions(omega, self.dt, poles) @ weights
        return np.asarray(np.fft.irfft(np.append(0.0, lines), self.n_samples))


def _free_motions(omega: Floats, dt: float, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return ``z^-i / A(z)`` with the sampled poles: exact for all end states, since z^-n is 1 at the lines of n samples."""
    delayed = np.exp(-1j * omega * dt)
    below = np.prod(1.0 - np.exp(poles * dt) * delayed[:, None], axis=1)
    return np.asarray(delayed[:, None] ** np.arange(poles.size) / below[:, None])


def plain_ratio(record: Record, local: FrequencyResponse, hold: Hold) -> PlainRatio:
    """Return the plain ratio at the lines of a local model of the same record, with the noise that this found."""
    assert local.line_noise is not None
    every = line_frequencies(record.n_samples, record.dt)
    lines = np.searchsorted(every, local.omega * (1.0 - 1e-9)) + 1
    source, response = (np.fft.rfft(record[name])[lines] for name in (local.source, local.response))
    drive = source * hold_response(local.omega, record.dt, hold)
    width = min(_SMOOTHED, lines.size)
    weights = np.ones(width)
    count = np.convolve(np.ones(lines.size), weights, mode="same")
    noise = np.convolve(local.line_noise, weights, mode="same") / count
    return PlainRatio(
        omega=local.omega,
        values=response / drive,
        source=local.source,
        response=local.response,
        unit=local.unit,
        variance=noise / np.abs(drive) ** 2,
        records=local.records,
        method=f"spectra with the noise of {local.method}",
        noise_freedom=2.0 * local.noise_freedom,
        drive=drive,
        dt=record.dt,
        n_samples=record.n_samples,
        hold=hold,
    )


def thesis_response(
    record: Record,
    source: str,
    response: str,
    phase_drop: float,
    upper_cut: float,
    lower_cut: float = 0.0,
) -> FrequencyResponse:
    """Return the frequency response as the thesis computes it; kept to reproduce its figures, not for identification.

    Parameters
    ----------
    record
        A sweep.
    source, response
        Names of the signals.
    phase_drop
        Assumed phase loss of the response over the band [rad]: pi for a PT2, pi / 2 for a PT1.
    upper_cut, lower_cut
        Frequencies beyond which the spectra are cut [rad/s]; the thesis keeps ``u -> psi`` up to 80 and ``psi -> y`` up to
        30 rad/s.

    Raises
    ------
    InputError
        If fewer than 30 points are left, a line of the source is zero, or the phase does not fall.

    Notes
    -----
    The unwrapped phase is multiplied by ``phase_drop`` over the difference of the means of its first and last 15 points and
    shifted to begin at zero. This hides any other phase change (a delay, a lag, a wrap due to noise). The magnitude is the
    plain ratio. There is no variance.
    """
    omega = line_frequencies(record.n_samples, record.dt)
    spectra = {name: np.fft.rfft(record[name])[1 : omega.size + 1] for name in (source, response)}
    kept = (omega >= lower_cut) & (omega <= upper_cut)
    if np.count_nonzero(kept) < 2 * _ENDS:
        raise InputError(
            f"Record '{record.name}': {np.count_nonzero(kept)} frequencies lie between the cuts {lower_cut:g} and "
            f"{upper_cut:g} rad/s, and the thesis's phase needs {2 * _ENDS}: widen the cuts or record longer."
        )
    below = spectra[source][kept]
    if (np.abs(below) == 0.0).any():
        raise InputError(
            f"Record '{record.name}': the source '{source}' has no content at some frequency between the cuts."
        )
    ratio = spectra[response][kept] / below
    phase = np.unwrap(np.angle(ratio))
    fallen = float(np.mean(phase[:_ENDS]) - np.mean(phase[-_ENDS:]))
    if fallen <= 0.0:
        raise InputError(
            f"Record '{record.name}': the unwrapped phase of '{source}' -> '{response}' rises by {-fallen:.3g} rad between "
            "the cuts, so the rescaling of the thesis would invert it: reduce the upper cut, or use another estimator."
        )
    phase = phase * (phase_drop / fallen)
    phase -= phase[0]
    return FrequencyResponse(
        omega=omega[kept],
        values=np.abs(ratio) * np.exp(1j * phase),
        source=source,
        response=response,
        unit=pair_unit(record, source, response),
        records=(record.name,),
        method="thesis: FFT ratio, phase rescaled",
    )
