"""Harmonics of a response along a sweep: odd ones indicate a symmetric, even ones an asymmetric nonlinearity.

The phase of the source is read off its zero crossings; within a few periods, fundamental and harmonics of that phase are
fitted to the response by least squares.

References
----------
A. Novak, L. Simon, F. Kadlec and P. Lotton, IEEE Trans. Instrumentation and Measurement 59 (2010) 2220, for the interpretation of
harmonics along a sweep. K. Worden and G. R. Tomlinson, *Nonlinearity in Structural Dynamics* (IOP 2001), chapter 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rigsight.errors import InputError
from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import pair_unit
from rigsight.records.record import Record

_JUMP = 3.0
"""Ratio of neighboring half periods beyond which zero crossings are not those of a sweep."""
_ALIAS = 0.9
"""Share of the Nyquist frequency that the highest harmonic may reach."""


@dataclass(frozen=True, eq=False)
class HarmonicTrack:
    """Harmonics of a response along a sweep.

    Attributes
    ----------
    omega
        Instantaneous angular frequency of the sweep [rad/s], shape (n_points,).
    t
        Time at which the sweep has this frequency [s], shape (n_points,).
    harmonics
        Complex amplitudes of the multiples 1, 2, ... of the sweep's phase, in the unit of the response, shape (n_points,
        n_harmonics). The phase is relative to the same multiple of the source's, sine to sine.
    fundamental
        First harmonic of the response over that of the source.
    """

    omega: NDArray[np.float64]
    t: NDArray[np.float64]
    harmonics: NDArray[np.complex128]
    fundamental: FrequencyResponse

    @property
    def odd_content(self) -> NDArray[np.float64]:
        """Root of the summed squares of harmonics 3, 5, ... over the fundamental, shape (n_points,)."""
        return self._content(2)

    @property
    def even_content(self) -> NDArray[np.float64]:
        """Root of the summed squares of harmonics 2, 4, ... over the fundamental, shape (n_points,)."""
        return self._content(1)

    def _content(self, first: int) -> NDArray[np.float64]:
        amplitudes = np.abs(self.harmonics)
        return np.asarray(np.linalg.norm(amplitudes[:, first::2], axis=1) / amplitudes[:, 0])


def track_harmonics(
    record: Record, source: str, response: str, *, n_harmonics: int = 5, periods: float = 6.0
) -> HarmonicTrack:
    """Return the harmonics of a response along a linear or logarithmic sweep.

    Parameters
    ----------
    record
        A sweep of rising frequency whose source has little noise, such as a commanded current.
    source, response
        Names of the signals.
    n_harmonics
        Highest multiple, at least 2.
    periods
        Length of the piece that one point is fitted to, in periods of the sweep, at least 2. A long piece smears a response
        that changes within it.

    Raises
    ------
    InputError
        If the source is not a sweep, has too few periods, or `n_harmonics` reaches the Nyquist frequency everywhere.

    Notes
    -----
    Amplitudes may change linearly within a piece. Points whose highest harmonic lies above 0.9 of the Nyquist frequency, or
    whose piece has fewer than two samples per unknown, are left out.
    """
    if n_harmonics < 2 or periods < 2.0:
        raise InputError(f"n_harmonics and periods must be at least 2, got {n_harmonics} and {periods:g}.")
    crossings = _crossings(record, source)
    passed = CubicSpline(crossings, np.pi * np.arange(crossings.size))
    total = (crossings.size - 1) / 2.0
    if total < periods:
        raise InputError(
            f"Record '{record.name}': '{source}' has {total:g} periods, fewer than the {periods:g} of one piece: record "
            "longer, or choose fewer periods."
        )
    t = record.t - record.t0
    inside = (t >= crossings[0]) & (t <= crossings[-1])
    phase, response_samples, source_samples = (
        passed(t[inside]),
        record[response][inside],
        record[source][inside],
    )
    # The first crossing may be a falling one; sines must have the sign of the source.
    turned = 0.0 if float(np.sum(np.sin(phase) * source_samples)) >= 0.0 else np.pi
    centers = 2.0 * np.pi * np.arange(0.5 * periods, total - 0.5 * periods + 1e-9, 1.0)
    times = CubicSpline(np.pi * np.arange(crossings.size), crossings)(centers)
    omega = np.asarray(passed(times, 1), dtype=np.float64)
    unknowns = 4 * n_harmonics + 2
    kept = n_harmonics * omega <= _ALIAS * np.pi / record.dt
    kept &= 2.0 * np.pi * periods / (omega * record.dt) >= 2 * unknowns
    kept &= np.concatenate([[True], omega[1:] > np.maximum.accumulate(omega)[:-1]])
    if not kept.any():
        raise InputError(
            f"Record '{record.name}': harmonic {n_harmonics} of '{source}' lies above the Nyquist frequency everywhere: ask "
            "for fewer harmonics, or sample faster."
        )
    rows, sources = [], []
    for center in centers[kept]:
        first, last = np.searchsorted(phase, [center - np.pi * periods, center + np.pi * periods])
        pieces = np.column_stack([response_samples[first:last], source_samples[first:last]])
        amplitudes = _fit(phase[first:last] + turned, pieces, n_harmonics)
        rows.append(amplitudes[:, 0])
        sources.append(amplitudes[0, 1])
    harmonics = np.array(rows)
    fundamental = FrequencyResponse(
        omega=omega[kept],
        values=harmonics[:, 0] / np.array(sources),
        source=source,
        response=response,
        unit=pair_unit(record, source, response),
        records=(record.name,),
        method=f"harmonic tracking, {periods:g} periods",
    )
    return HarmonicTrack(
        omega=omega[kept], t=times[kept] + record.t0, harmonics=harmonics, fundamental=fundamental
    )


def _crossings(record: Record, source: str) -> NDArray[np.float64]:
    """Return the times at which the source passes zero, counted from the first sample."""
    signal = record[source]
    signal = np.where(signal == 0.0, np.finfo(np.float64).tiny, signal)
    before = np.flatnonzero(np.signbit(signal[1:]) != np.signbit(signal[:-1]))
    if before.size < 4:
        raise InputError(
            f"Record '{record.name}': '{source}' passes zero {before.size} times: harmonics need a sweep."
        )
    crossings = (before + signal[before] / (signal[before] - signal[before + 1])) * record.dt
    halves = np.diff(crossings)
    ratio = float(np.max(np.maximum(halves[1:] / halves[:-1], halves[:-1] / halves[1:])))
    if ratio > _JUMP:
        raise InputError(
            f"Record '{record.name}': half periods of '{source}' change by a factor of {ratio:.3g} from one to the next: it is "
            f"not a sweep, has an offset, or is noisy around zero. Cut the record to the sweep, or use the commanded input."
        )
    return np.asarray(crossings)


def _fit(phase: NDArray[np.float64], pieces: NDArray[np.float64], n_harmonics: int) -> NDArray[np.complex128]:
    """Return the amplitudes in the middle of a piece, shape (n_harmonics, n_signals)."""
    middle = 0.5 * (phase[0] + phase[-1])
    position = (phase - middle) / (phase[-1] - phase[0])
    multiples = np.arange(1, n_harmonics + 1) * phase[:, None]
    steady = np.concatenate([np.sin(multiples), np.cos(multiples), np.ones((phase.size, 1))], axis=1)
    terms = np.concatenate([steady, position[:, None] * steady], axis=1)
    # Sines over whole periods are nearly orthogonal, so the normal equations lose no accuracy.
    found = np.linalg.solve(terms.T @ terms, terms.T @ pieces)
    return np.asarray(found[:n_harmonics] + 1j * found[n_harmonics : 2 * n_harmonics])
