"""Frequency response of a record: method and resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, check_option
from rigsight.frequency import (
    FrequencyResponse,
    averaged_response,
    local_polynomial_response,
    local_rational_response,
    thesis_response,
)
from rigsight.frequency.signal_pair import excited, line_frequencies
from rigsight.identify.transfer.transfer_form import Order
from rigsight.records.periods import mean_period
from rigsight.records.record import Hold, Record

Method = Literal["local_rational", "local_polynomial", "h1", "thesis"]
METHODS: tuple[Method, ...] = ("local_rational", "local_polynomial", "h1", "thesis")

_BAND_LINES = {"local_rational": 15, "local_polynomial": 13}
"""Lines of one local band: its unknowns and six more degrees of freedom, up to the next odd number."""
_LOCAL_VALUES = 3.0
_HANN_LINES = 1.5
"""Equivalent noise bandwidth of a Hann window, in lines."""
_SEGMENTS = 8
"""Length of a record in segments of an averaged spectrum, which overlap by half: a compromise between bias and variance."""
_PEAK_LINES = {"local_rational": 2.0, "local_polynomial": 13.0, "h1": 4.0, "thesis": 2.0}
"""Lines (or distances of averaged frequencies) that the half-power width of a peak must contain for a method to follow it."""
_CLEAR = 100.0
"""Power over variance (20 dB) above which a local model of a noisy response can be trusted."""
_MOSTLY, _LEAST_SHARE = 0.8, 0.05
_THESIS_CUTS = {"pt2": 80.0, "pt1": 30.0}
_THESIS_DROPS = {"pt2": math.pi, "pt1": math.pi / 2.0}


@dataclass(frozen=True, eq=False)
class RecordResponse:
    """A frequency response with its resolution and coherence.

    Attributes
    ----------
    response
        The frequency response in the band in which it exceeds its uncertainty.
    lines_per_value
        Lines per independent value, by which a covariance that counts lines as independent is too small. A local model of degree
        two has three coefficients for the response in its band; a Hann window correlates neighbors.
    resolution
        Distance of its frequencies [rad/s].
    narrowest
        Half-power width of the narrowest peak that the method follows at this resolution [rad/s].
    coherence
        H1 with its coherence from segments of the same record; None if it is not requested or the record is too short for it.
    unused_instrument
        Reason why the given instrument was not used; empty if it was used, or if there is none.
    """

    response: FrequencyResponse
    lines_per_value: float
    resolution: float
    narrowest: float
    coherence: FrequencyResponse | None
    unused_instrument: str = ""


def record_response(
    record: Record,
    source: str,
    response: str,
    order: Order,
    method: Method = "local_rational",
    resolution: float | None = None,
    hold: Hold = "band_limited",
    band: tuple[float, float] | None = None,
    least_clearness: float = _CLEAR,
    clear_alone: bool = False,
    with_coherence: bool = True,
    wanted: NDArray[np.float64] | None = None,
    instrument: str | None = None,
    drive: str | None = None,
) -> RecordResponse:
    """Return the frequency response of one record.

    Parameters
    ----------
    record
        A sweep, a multisine, or another input that excites a band. Whole periods of a periodic input are averaged, without the
        first, which contains the transient.
    source, response
        Names of the signals.
    order
        Assumed order of the response; only the thesis's pipeline needs it.
    method
        ``"local_rational"``, ``"local_polynomial"``, ``"h1"`` or ``"thesis"``.
    resolution
        Requested width [rad/s] of a local band, or distance of averaged frequencies. None takes the default of the record.
    hold
        Hold of the source between its samples, see `rigsight.frequency.hold_response`.
    band
        Limits [rad/s] inside which the response is kept; None keeps all that the source excites.
    least_clearness
        Power over variance from which a line of a local method counts as clear; 0 keeps all lines.
    clear_alone
        True to leave out unclear lines even if few are clear, as needed for errors without weights. A fit has weights and takes
        all lines in this case.
    with_coherence
        False if the coherence is not needed: it takes a third of the time of a local model.
    wanted
        Required frequencies [rad/s]; a local method skips other lines. None for all.
    instrument
        The reference of a closed loop: a local method divides the responses to it, unless the source does not respond to it.
    drive
        The input whose periods are averaged: the noise of a measured source hides its period. None for the source.

    Raises
    ------
    InputError
        If the record is too short or has no excitation, or no line is inside the band.
    """
    check_option("The method", method, METHODS)
    drive, unused = drive or source, ""
    if instrument is not None and method not in _BAND_LINES:
        unused, instrument = f"The method '{method}' does not use it; local_rational does.", None
    coherence = _coherence(record, source, response, hold) if with_coherence else None
    if method == "thesis":
        periodic, note = _mean_period(record, drive)
        found, width, shared = _noted(_thesis(periodic, source, response, order), note), _line(periodic), 1.0
    elif method == "h1":
        width = resolution or _SEGMENTS * _line(record)
        found, shared = averaged_response(record, source, response, width, hold=hold), _HANN_LINES
    else:
        local = partial(
            _local,
            record,
            source,
            response,
            drive,
            method,
            resolution,
            hold,
            wanted,
            least_clearness,
            clear_alone,
        )
        try:
            found, width, shared = local(instrument)
        except InputError as error:
            if instrument is None:
                raise
            unused = str(error)
            found, width, shared = local(None)
    if band is not None:
        found = found.band(*band)
    return RecordResponse(found, shared, width, _PEAK_LINES[method] * width, coherence, unused)


def _line(record: Record) -> float:
    """Return the distance of a record's spectral lines [rad/s]."""
    return 2.0 * math.pi / (record.n_samples * record.dt)


def _local(
    record: Record,
    source: str,
    response: str,
    drive: str,
    method: Method,
    resolution: float | None,
    hold: Hold,
    wanted: NDArray[np.float64] | None,
    least_clearness: float,
    clear_alone: bool,
    instrument: str | None,
) -> tuple[FrequencyResponse, float, float]:
    """Return the response by a local method, its resolution [rad/s] and its lines per independent value."""
    periodic, note = _mean_period(record, instrument or drive)
    line = _line(periodic)
    lines = max(_BAND_LINES[method], round((resolution or 0.0) / line))
    local = local_rational_response if method == "local_rational" else local_polynomial_response
    found = local(
        periodic,
        source,
        response,
        bandwidth=resolution or lines * line,
        transient=periodic is record,
        hold=hold,
        wanted=wanted,
        instrument=instrument,
    )
    clear = _noted(_clear(found, lines, least_clearness, 0.0 if clear_alone else _LEAST_SHARE), note)
    return clear, line * lines / _BAND_LINES[method], lines / _LOCAL_VALUES


def _noted(found: FrequencyResponse, note: str) -> FrequencyResponse:
    return replace(found, method=f"{found.method}, {note}") if note else found


def _mean_period(record: Record, drive: str) -> tuple[Record, str]:
    """Return the mean of the periods of an input, and which these are; or the unchanged record and nothing."""
    mean, count = mean_period(record, [drive])
    if count == 0:
        return record, ""
    return mean, "period 2" if count == 1 else f"mean of periods 2 to {count + 1}"


def _coherence(record: Record, source: str, response: str, hold: Hold) -> FrequencyResponse | None:
    width = _SEGMENTS * _line(record)
    try:
        return averaged_response(record, source, response, width, hold=hold)
    except InputError:
        return None


def _thesis(record: Record, source: str, response: str, order: Order) -> FrequencyResponse:
    omega = line_frequencies(record.n_samples, record.dt)
    power = np.abs(np.fft.rfft(record[source] - np.mean(record[source]))[1 : omega.size + 1]) ** 2
    smooth = np.convolve(power, np.full(15, 1.0 / 15.0), mode="same")
    heard = omega[excited(omega, smooth, None, f"Record '{record.name}': the source '{source}'")]
    # The cuts are those of the thesis's rig, whose resonance is near 12 rad/s.
    upper = min(_THESIS_CUTS[order], float(heard[-1]))
    return thesis_response(record, source, response, _THESIS_DROPS[order], upper, float(heard[0]))


def _clear(found: FrequencyResponse, lines: int, least: float, least_share: float) -> FrequencyResponse:
    """Keep the lines between the outermost local bands in which most lines clearly exceed their uncertainty.

    Single lines may do so by chance, above all where the beginning of a sweep cannot be distinguished from a transient.
    """
    assert found.variance is not None
    clear = np.abs(found.values) ** 2 > least * found.variance
    if clear.size <= lines or least == 0.0:
        return found
    share = np.convolve(
        np.pad(clear.astype(np.float64), lines // 2, mode="edge"), np.ones(lines) / lines, "valid"
    )
    inside = np.flatnonzero(clear & (share[: clear.size] >= _MOSTLY))
    if inside.size <= least_share * clear.size:
        return found
    kept = np.zeros(clear.size, dtype=np.bool_)
    kept[inside[0] : inside[-1] + 1] = True
    return found.at(kept)


def driven_band(record: Record, source: str) -> tuple[float, float]:
    """Return the band with 99 % of the power of a source [rad/s]."""
    omega = line_frequencies(record.n_samples, record.dt)
    power = np.abs(np.fft.rfft(record[source] - np.mean(record[source]))[1 : omega.size + 1]) ** 2
    total = np.cumsum(power) / np.sum(power)
    low, high = np.searchsorted(total, [0.005, 0.995])
    return float(omega[low]), float(omega[min(high, omega.size - 1)])
