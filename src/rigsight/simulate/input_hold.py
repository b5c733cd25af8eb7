"""Input between its samples, as a cubic polynomial per interval, and beyond its ends.

The hold limits how well a model can fit: with linear interpolation, a sampled analog signal looks like one with a small delay and
a gain error that grows with frequency.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from typing import Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from rigsight.records.record import Floats

Hold = Literal["zoh", "foh", "band_limited"]

BAND_LIMITED_INTERVALS = 2
"""Cubic pieces per sample of a band-limited input that one piece per sample does not follow."""
_FOLLOWED = 1e-5
"""RMS error of one piece per sample in the middle between samples, in units of the input's standard deviation, up to which it is
enough: that of the windowed sinc itself, whose stop band is at -100 dB. The error of a response is at most about twice that, with
a lightly damped resonance at the highest frequency of a sweep."""
_OVERSAMPLING = 16
_HALF_LENGTH = 48
_LONGEST_KEPT = 50_000
"""Samples up to which an input is cached for the next model; the cache stays below half a gigabyte."""

_ORDER, _KNOWN = 24, 240
"""Samples that a prediction weighs, enough for twelve tones, and samples at the end to which it is fitted."""
_RANK = 1e-12
"""Share of the largest power below which a direction is rounding error; samples of a few tones are linearly dependent."""


@dataclass(frozen=True)
class HeldInput:
    """An input, or several, between its samples."""

    # Shape (n_intervals + 1, 4), for several inputs (n_intervals + 1, n_inputs, 4): ``c0 + c1 tau + c2 tau^2
    # + c3 tau^3`` with tau [s] from the start of each interval; row 0 is the input before the record, held at
    # its first value.
    coefficients: Floats
    interval: float  # length of an interval [s]
    per_sample: int  # intervals per sample time
    continuous: bool  # false if the input jumps between intervals

    @property
    def n_pieces(self) -> int:
        """Number of intervals of the record."""
        return int(self.coefficients.shape[0]) - 1

    def first(self, n_samples: int) -> HeldInput:
        """Return the input of the first samples."""
        return replace(self, coefficients=self.coefficients[: (n_samples - 1) * self.per_sample + 1])

    def with_input(self, column: int, held: HeldInput) -> HeldInput:
        """Return the same inputs with another one in the place of one of them; longer pieces are divided."""
        ours, theirs = _alike_divided((self, held))
        rows = ours.coefficients.reshape(ours.n_pieces + 1, -1, 4).copy()
        rows[:, column] = theirs.coefficients
        continuous = self.continuous and held.continuous
        return replace(ours, coefficients=rows.reshape(ours.coefficients.shape), continuous=continuous)

    def plus(self, change: HeldInput) -> HeldInput:
        """Return the sum of the same inputs of one record; longer pieces are divided."""
        ours, theirs = _alike_divided((self, change))
        continuous = self.continuous and change.continuous
        return replace(ours, coefficients=ours.coefficients + theirs.coefficients, continuous=continuous)

    def read_ahead(self, column: int, by: float) -> HeldInput:
        """Return the same with one input advanced in time, with cubic Hermite interpolation between nodes."""
        # Beyond either end it is continued with its slope and curvature there.
        n, rows = self.n_pieces, self.coefficients.reshape(self.n_pieces + 1, -1, 4)
        if n == 0 or by == 0.0:
            return self
        place = np.arange(n + 1) + by / self.interval
        piece = np.clip(np.floor(place).astype(np.int64), 0, n - 1)
        tau = self.interval * (place - piece)
        inside = np.clip(tau, 0.0, self.interval)
        c0, c1, c2, c3 = rows[1 + piece, column].T
        value = c0 + inside * (c1 + inside * (c2 + inside * c3))
        slope = c1 + inside * (2.0 * c2 + 3.0 * inside * c3)
        bend = 2.0 * c2 + 6.0 * inside * c3
        beyond = tau - inside
        shifted = hold_motion(
            value + beyond * (slope + 0.5 * beyond * bend), slope + beyond * bend, self.interval
        )
        found = rows.copy()
        found[:, column] = shifted.coefficients
        return replace(self, coefficients=found.reshape(self.coefficients.shape))

    def at_samples(self, n_samples: int) -> Floats:
        """Return each input with its first and second time derivative at the samples, shape (3 n_inputs, n_samples)."""
        # The values are those of the piece that begins there; at the last sample, those of the piece that ends there.
        rows = self.coefficients.reshape(self.n_pieces + 1, -1, 4)
        starts = rows[1 :: self.per_sample][: n_samples - 1]
        tau, (c0, c1, c2, c3) = (self.interval if self.n_pieces else 0.0), rows[-1].T
        values = [c0 + tau * (c1 + tau * (c2 + tau * c3)), c1 + tau * (2.0 * c2 + 3.0 * tau * c3)]
        last = np.stack([*values, c2 + 3.0 * tau * c3])
        found = np.concatenate([starts[:, :, :3], last.T[None]])
        found[:, :, 2] *= 2.0
        return np.moveaxis(found, 0, 2).reshape(-1, found.shape[0])


def hold_input(samples: Floats, dt: float, hold: Hold) -> HeldInput:
    """Return the input between its samples."""
    samples = np.ascontiguousarray(samples, dtype=np.float64)
    if samples.size > _LONGEST_KEPT:
        return _between(samples, dt, hold)
    return _kept(samples.tobytes(), dt, hold)


# Cached, because a diagnosis fits hundreds of models to the same few records and their windows.
@lru_cache(maxsize=128)
def _kept(content: bytes, dt: float, hold: Hold) -> HeldInput:
    return _between(np.frombuffer(content, dtype=np.float64), dt, hold)


def _between(samples: Floats, dt: float, hold: Hold) -> HeldInput:
    if hold == "band_limited":
        nodes, slopes = _band_limited_nodes(samples, dt)
        per_sample = BAND_LIMITED_INTERVALS
        if _is_followed_by_one_piece(nodes, slopes, dt):
            nodes, slopes, per_sample = nodes[::per_sample], slopes[::per_sample], 1
        return replace(hold_motion(nodes, slopes, dt / per_sample), per_sample=per_sample)
    rows = np.zeros((samples.size, 4))
    rows[0, 0] = samples[0]
    rows[1:, 0] = samples[:-1]
    if hold == "foh":
        rows[1:, 1] = np.diff(samples) / dt
    return HeldInput(rows, dt, 1, continuous=hold != "zoh")


def hold_motion(values: Floats, rates: Floats, dt: float) -> HeldInput:
    """Return a prescribed motion between samples from displacement and velocity, both of shape (n_samples,)."""
    rows = np.zeros((values.size, 4))
    rows[0, 0] = values[0]
    rise = np.diff(values)
    first, last = rates[:-1] * dt, rates[1:] * dt
    rows[1:, 0] = values[:-1]
    rows[1:, 1] = rates[:-1]
    rows[1:, 2] = (3.0 * rise - 2.0 * first - last) / dt**2
    rows[1:, 3] = (first + last - 2.0 * rise) / dt**3
    return HeldInput(rows, dt, 1, continuous=True)


def hold_accelerated_motion(values: Floats, rates: Floats, accelerations: Floats, dt: float) -> HeldInput:
    """Return a prescribed motion between samples from displacement, velocity and acceleration, each of shape (n_samples,)."""
    # One cubic piece per sample, given by displacements and velocities, has an acceleration that is wrong by 1 % at 17 samples a
    # cycle. Two pieces can have the given acceleration at both ends; displacement and velocity are continuous in the middle.
    h = 0.5 * dt
    v0, v1, s0, s1 = values[:-1], values[1:], rates[:-1], rates[1:]
    a0, a1 = accelerations[:-1], accelerations[1:]
    # Cubic terms c of the first piece and d of the second, counted from its end: their sum from the displacement in the
    # middle, their difference from the velocity there.
    total = (v1 - v0 - (s0 + s1) * h + 0.5 * (a1 - a0) * h**2) / h**3
    difference = (s1 - s0 - (a0 + a1) * h) / (3.0 * h**2)
    c, d = 0.5 * (total + difference), 0.5 * (total - difference)
    rows = np.zeros((2 * (values.size - 1) + 1, 4))
    rows[0, 0] = values[0]
    rows[1::2] = np.column_stack([v0, s0, 0.5 * a0, c])
    rows[2::2] = np.column_stack(
        [v0 + h * (s0 + h * (0.5 * a0 + h * c)), s0 + h * (a0 + 3.0 * h * c), 0.5 * a1 - 3.0 * d * h, d]
    )
    return HeldInput(rows, h, 2, continuous=True)


def together(inputs: Sequence[HeldInput]) -> HeldInput:
    """Return several inputs as one; pieces are divided if those of other inputs are shorter."""
    if len(inputs) == 1:
        return inputs[0]
    divided = _alike_divided(inputs)
    return replace(
        divided[0],
        coefficients=np.stack([held.coefficients for held in divided], axis=1),
        continuous=all(held.continuous for held in inputs),
    )


def _alike_divided(inputs: Sequence[HeldInput]) -> list[HeldInput]:
    """Return inputs of one record, each with as many pieces per sample as the others."""
    per_sample = math.lcm(*(held.per_sample for held in inputs))
    return [_divided(held, per_sample // held.per_sample) for held in inputs]


def _divided(held: HeldInput, parts: int) -> HeldInput:
    """Return an input with every piece divided into equal parts."""
    if parts == 1:
        return held
    interval, whole = held.interval / parts, held.coefficients
    c0, c1, c2, c3 = np.moveaxis(whole[1:], -1, 0)
    rows = np.empty((parts * held.n_pieces + 1, *whole.shape[1:]))
    rows[0] = whole[0]
    for part in range(parts):
        s, own = part * interval, rows[1 + part :: parts]
        own[..., 0] = c0 + s * (c1 + s * (c2 + s * c3))
        own[..., 1] = c1 + s * (2.0 * c2 + 3.0 * s * c3)
        own[..., 2], own[..., 3] = c2 + 3.0 * s * c3, c3
    return HeldInput(rows, interval, held.per_sample * parts, held.continuous)


def _band_limited_nodes(samples: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return values and slopes at the interval boundaries, from a windowed-sinc interpolation."""
    from scipy.signal import upfirdn

    values, slopes = _interpolation_taps()
    pad = _HALF_LENGTH + 2
    extended = continued(samples, pad)
    start = (_HALF_LENGTH + pad) * BAND_LIMITED_INTERVALS
    nodes = slice(start, start + (samples.size - 1) * BAND_LIMITED_INTERVALS + 1)
    at_nodes, rising = (
        upfirdn(taps, extended, up=BAND_LIMITED_INTERVALS)[nodes] for taps in (values, slopes)
    )
    return at_nodes, rising * (BAND_LIMITED_INTERVALS / dt)


def _is_followed_by_one_piece(nodes: Floats, slopes: Floats, dt: float) -> bool:
    """Return True if one cubic piece per sample, through values and slopes at the samples, follows the input between them."""
    # Twice as many pieces take a fit twice as many integration steps.
    at_samples, rising = nodes[::BAND_LIMITED_INTERVALS], slopes[::BAND_LIMITED_INTERVALS]
    in_the_middle = nodes[BAND_LIMITED_INTERVALS // 2 :: BAND_LIMITED_INTERVALS]
    cubic = 0.5 * (at_samples[:-1] + at_samples[1:]) - dt / 8.0 * np.diff(rising)
    off = np.sqrt(np.mean((cubic - in_the_middle) ** 2)) if in_the_middle.size else 0.0
    return bool(off <= _FOLLOWED * np.std(at_samples))


@cache
def _interpolation_taps() -> tuple[Floats, Floats]:
    """Return the filters that give values and slopes [per interval] at the interval boundaries."""
    # The slope is the fourth-order difference quotient of a finer interpolation, of which only the values at the boundaries are
    # computed.
    from scipy.signal import firwin

    fine = _OVERSAMPLING * BAND_LIMITED_INTERVALS
    taps = fine * firwin(2 * _HALF_LENGTH * fine + 1, 1.0 / fine, window=("kaiser", 10.0))
    around = np.pad(taps, 2)
    rise = 8.0 * (around[3:-1] - around[1:-3]) - (around[4:] - around[:-4])
    return taps[::_OVERSAMPLING], rise[::_OVERSAMPLING] / 12.0 * _OVERSAMPLING


def continued(samples: Floats, count: int) -> Floats:
    """Return a signal with additional samples before its beginning and after its end, by linear prediction."""
    # A reflection about the last sample would reverse the curvature there: the slope at the end of an interpolation would be off
    # by as much as a tenth of its size.
    # S. M. Kay, *Modern Spectral Estimation* (Prentice Hall 1988), chapter 7, for the modified covariance method.
    return np.concatenate([_following(samples[::-1], count)[::-1], samples, _following(samples, count)])


def _following(samples: Floats, count: int) -> Floats:
    order, known = min(_ORDER, samples.size // 3), samples[-_KNOWN:]
    mean, low, high = float(np.mean(known)), float(np.min(known)), float(np.max(known))
    if order == 0 or low == high:
        return np.full(count, samples[-1])
    # Scaled to unit size, because squares of a diverging motion may overflow although its prediction does not.
    rows = sliding_window_view((known - mean) / max(high - mean, mean - low), order + 1)
    regressors = np.vstack([rows[:, -2::-1], rows[:, 1:]])
    # Normal equations: ten times as fast as a singular value decomposition, and this runs for every window of every record.
    powers, directions = np.linalg.eigh(regressors.T @ regressors)
    directions, powers = directions[:, powers > _RANK * powers[-1]], powers[powers > _RANK * powers[-1]]
    reported = directions.T @ (regressors.T @ np.concatenate([rows[:, -1], rows[:, 0]]))
    weights = directions @ (reported / powers)
    # Limited, because noise may make the prediction unstable.
    lowest, highest = 2.0 * low - high - mean, 2.0 * high - low - mean
    latest = (known - mean)[: -order - 1 : -1].tolist()
    for _ in range(count):
        latest.insert(0, min(max(float(weights @ latest[:order]), lowest), highest))
    return mean + np.array(latest[count - 1 :: -1])
