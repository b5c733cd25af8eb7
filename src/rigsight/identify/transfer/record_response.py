"""Frequency response of a record: method and resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal, TypeVar

import numpy as np

from rigsight.errors import InputError, check_option
from rigsight.frequency import (
    FrequencyResponse,
    averaged_response,
    local_polynomial_response,
    local_rational_response,
    thesis_response,
)
from rigsight.frequency.signal_pair import excited, line_frequencies
from rigsight.frequency.spectral import PlainRatio, plain_ratio
from rigsight.identify.transfer.transfer_form import Order, TransferFit
from rigsight.identify.transfer.transfer_function import MISFIT, fit_frequency_response
from rigsight.records.record import Floats, Hold, Record
from rigsight.records.signals import mean_period

_Response = TypeVar("_Response", bound=FrequencyResponse)
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
_SHARES = tuple(float(share) for share in np.geomspace(0.01, 0.4, 7))
_THESIS_DROPS = {"pt2": math.pi, "pt1": math.pi / 2.0}


@dataclass(frozen=True, eq=False)
class RecordResponse:
    """A frequency response with its resolution and coherence."""

    response: FrequencyResponse  # the frequency response in the band in which it exceeds its uncertainty
    # Lines per independent value, by which a covariance that counts lines as independent is too small. A
    # local model of degree two has three coefficients for the response in its band; a Hann window correlates
    # neighbors.
    lines_per_value: float
    resolution: float  # distance of its frequencies [rad/s]
    # Half-power width of the narrowest peak that the method follows at this resolution [rad/s].
    narrowest: float
    # H1 with its coherence from segments of the same record; None if it is not requested or the record is too
    # short for it.
    coherence: FrequencyResponse | None
    # Reason why the given instrument was not used; empty if it was used, or if there is none.
    unused_instrument: str = ""
    # The plain ratio of the spectra in the band in which it exceeds its uncertainty, for a fit of a form with
    # the free motion of the record; None if the form of that is unknown, or whole periods were averaged, or
    # an instrument was used.
    plain: PlainRatio | None = None
    fit: TransferFit | None = None  # the fit of the form of `order` to it; None if there is none


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
    wanted: Floats | None = None,
    instrument: str | None = None,
    drive: str | None = None,
    moves_freely: bool = False,
    upper_cut: float = math.inf,
) -> RecordResponse:
    """Return the frequency response of one record; only the method of the thesis reads its cut."""
    check_option("The method", method, METHODS)
    drive, unused = drive or source, ""
    if instrument is not None and method not in _BAND_LINES:
        unused, instrument = f"The method '{method}' does not use it; local_rational does.", None
    coherence = _coherence(record, source, response, hold) if with_coherence else None
    plain, fit = None, None
    if method == "thesis":
        periodic, note = _mean_period(record, drive)
        whole = _thesis(periodic, source, response, order, upper_cut)
        found, width, shared = _noted(whole, note), _line(periodic), 1.0
    elif method == "h1":
        width = resolution or _SEGMENTS * _line(record)
        found, shared = averaged_response(record, source, response, width, hold=hold), _HANN_LINES
        if moves_freely and _mean_period(record, drive)[0] is record:
            local = local_rational_response(record, source, response, hold=hold)
            plain = _clear(
                plain_ratio(record, local, hold), _BAND_LINES["local_rational"], _CLEAR, _LEAST_SHARE
            )
    else:
        estimator = _Local(record, source, response, drive, method, resolution, hold, wanted, band)
        try:
            found, plain, fit = estimator.response(instrument, order, moves_freely)
        except InputError as error:
            if instrument is None:
                raise
            unused, instrument = str(error), None
            found, plain, fit = estimator.response(None, order, moves_freely)
        lines, width, shared, note = estimator.resolved(instrument)
        found = _noted(_clear(found, lines, least_clearness, 0.0 if clear_alone else _LEAST_SHARE), note)
    if band is not None:
        found = found.band(*band)
    return RecordResponse(found, shared, width, _PEAK_LINES[method] * width, coherence, unused, plain, fit)


def _line(record: Record) -> float:
    """Return the distance of a record's spectral lines [rad/s]."""
    return 2.0 * math.pi / (record.n_samples * record.dt)


@dataclass(frozen=True)
class _Local:
    """A local method for one pair of signals of a record."""

    record: Record
    source: str
    name: str
    drive: str
    method: Method
    resolution: float | None
    hold: Hold
    wanted: Floats | None
    band: tuple[float, float] | None

    def resolved(self, instrument: str | None) -> tuple[int, float, float, str]:
        """Return lines of a band, the resolution [rad/s], lines per independent value, and which periods were averaged."""
        periodic, note = _mean_period(self.record, instrument or self.drive)
        line = _line(periodic)
        lines = max(_BAND_LINES[self.method], round((self.resolution or 0.0) / line))
        return lines, line * lines / _BAND_LINES[self.method], lines / _LOCAL_VALUES, note

    def response(
        self, instrument: str | None, order: Order, moves_freely: bool
    ) -> tuple[FrequencyResponse, PlainRatio | None, TransferFit | None]:
        """Return the response, and the plain ratio and its fit if the free motion of the record has a known form."""
        periodic, _ = _mean_period(self.record, instrument or self.drive)
        found = self._estimated(periodic, periodic is self.record, instrument)
        if not moves_freely or periodic is not self.record or instrument is not None:
            return found, None, None
        every = plain_ratio(self.record, found, self.hold)
        assert every.variance is not None
        clear = np.count_nonzero(np.abs(every.values) ** 2 > _CLEAR * every.variance)
        if order == "pt2" and clear < 2 * _BAND_LINES[self.method]:
            # Below the noise for which a local model can be trusted, its noise is too small, and so are errors by it.
            return found, None, None
        plain = _clear(every, _BAND_LINES[self.method], _CLEAR, _LEAST_SHARE)
        plain = plain if self.band is None else plain.band(*self.band)
        try:
            fit = near = fit_frequency_response(plain, order)
            if fit.misfit > MISFIT:
                near, _ = fit_with_relative_error(plain, order, magnitude_only=False)
        except InputError:
            return found, plain, None
        poles = near.form.poles(near.theta)
        moved = self.record[self.name] - plain.free_motion(near.free_motion, poles)
        alone = self._estimated(self.record.with_signals(**{self.name: moved}), False, None)
        motions = every.free_motions(poles)
        spread = np.einsum("ki,ij,kj->k", motions.conj(), near.free_motion_covariance, motions).real
        return _smaller_variance(found, alone, np.maximum(spread, 0.0)), plain, fit

    def _estimated(self, record: Record, transient: bool, instrument: str | None) -> FrequencyResponse:
        lines, *_ = self.resolved(instrument)
        estimate = local_rational_response if self.method == "local_rational" else local_polynomial_response
        return estimate(
            record,
            self.source,
            self.name,
            bandwidth=self.resolution or lines * _line(record),
            transient=transient,
            hold=self.hold,
            wanted=self.wanted,
            instrument=instrument,
        )


def fit_with_relative_error(
    response: FrequencyResponse, order: Order, magnitude_only: bool
) -> tuple[TransferFit, float]:
    """Return a fit and the relative error, the same for every line, with which the form explains the response."""
    # With the variances of the noise alone, the few most certain lines would dominate, wherever they are.
    assert response.variance is not None
    for share in _SHARES:
        variance = response.variance + (share * response.magnitude) ** 2
        fit = fit_frequency_response(
            replace(response, variance=variance, noise_shares=None, noise_lines=None),
            order,
            magnitude_only=magnitude_only,
        )
        if fit.misfit <= 1.0:
            break
    return fit, share


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


def _thesis(record: Record, source: str, response: str, order: Order, upper_cut: float) -> FrequencyResponse:
    omega = line_frequencies(record.n_samples, record.dt)
    power = np.abs(np.fft.rfft(record[source] - np.mean(record[source]))[1 : omega.size + 1]) ** 2
    width = min(15, power.size)
    smooth = np.convolve(power, np.full(width, 1.0 / width), mode="same")
    heard = omega[excited(omega, smooth, None, f"Record '{record.name}': the source '{source}'")]
    upper = min(upper_cut, float(heard[-1]))
    return thesis_response(record, source, response, _THESIS_DROPS[order], upper, float(heard[0]))


def _smaller_variance(found: FrequencyResponse, other: FrequencyResponse, extra: Floats) -> FrequencyResponse:
    """Return at each line the one of two local models of the same bands that has the smaller variance."""
    assert found.variance is not None
    assert other.variance is not None
    assert found.noise_shares is not None
    assert other.noise_shares is not None
    better = other.variance + extra < found.variance
    return replace(
        found,
        values=np.where(better, other.values, found.values),
        variance=np.where(better, other.variance + extra, found.variance),
        noise_shares=np.where(better[:, None], other.noise_shares, found.noise_shares),
    )


def _clear(found: _Response, lines: int, least: float, least_share: float) -> _Response:
    """Keep the lines between the outermost local bands in which most lines clearly exceed their uncertainty."""
    # Single lines may do so by chance, above all where the beginning of a sweep cannot be distinguished from a transient.
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
