"""Frequency response from averaged spectra: H1, H2 and Hv over overlapping segments.

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
from typing import Any, Literal, get_args

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from rigsight.errors import InputError, check_in_range, check_option
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import (
    check_alike,
    check_resolution,
    excited,
    hold_response,
    line_frequencies,
    pair_unit,
)
from rigsight.records.record import Hold, Record

Estimator = Literal["H1", "H2", "Hv"]


def averaged_response(
    records: Record | Sequence[Record],
    source: str,
    response: str,
    resolution: float,
    *,
    estimator: Estimator = "H1",
    window: str = "hann",
    overlap: float = 0.5,
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
) -> FrequencyResponse:
    """Return the frequency response from cross and auto spectra averaged over segments.

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
    window
        Name of a window of ``scipy.signal.get_window``.
    overlap
        Share of a segment that the next one repeats, 0 to 0.9.
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
    check_in_range("The overlap", overlap, 0.0, 0.9)
    dt = several[0].dt
    shortest = min(several, key=lambda record: record.n_samples)
    what = f"Record '{shortest.name}'"
    check_resolution(resolution, shortest.n_samples * dt, 1.0, what)
    length = round(2.0 * math.pi / (resolution * dt))
    step = length - math.floor(overlap * length)
    counts = np.array([1 + (record.n_samples - length) // step for record in several])
    if counts.sum() < 2:
        raise InputError(
            f"{what} holds one segment of {length * dt:.4g} s, and a single segment has no coherence: allow a resolution of "
            f"{2.0 * resolution:.4g} rad/s, or give more records."
        )
    try:
        weights = scipy.signal.get_window(window, length)
    except ValueError:
        raise InputError(
            f"The window '{window}' is not known to scipy.signal.get_window; use one such as 'hann'."
        ) from None
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
        method=f"{estimator}, {window} window, {int(counts.sum())} segments of {length * dt:.4g} s",
    )


def _spectra(
    records: Sequence[Record],
    source: str,
    response: str,
    window: NDArray[np.float64],
    overlapping: int,
    counts: NDArray[np.int_],
) -> NDArray[np.complex128]:
    """Return the power of source and response and their cross spectrum over all segments, shape (3, n_lines)."""
    # scipy's stubs know neither samples of a window nor the default of detrend.
    csd: Any = functools.partial(scipy.signal.csd, window=window, noverlap=overlapping, detrend="constant")
    pairs = ((source, source), (response, response), (source, response))
    spectra = [[csd(r[a], r[b], 1.0 / r.dt)[1] for a, b in pairs] for r in records]
    return np.asarray(np.average(spectra, axis=0, weights=counts), dtype=np.complex128)


def _independent(window: NDArray[np.float64], step: int, n_segments: float) -> float:
    """Return the number of independent segments with the variance of the overlapping ones; Welch's formula."""
    power = float(window @ window)
    shared = 0.0
    for shift in range(step, window.size, step):
        correlation = float(window[shift:] @ window[:-shift]) / power
        shared += 2.0 * (1.0 - shift / step / n_segments) * correlation**2
    return n_segments / (1.0 + max(shared, 0.0))
