"""Waveforms of inputs as functions of continuous time.

A random rig is driven by these functions; a record contains their samples.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

Signal = Callable[[float], float]


class Waveform(Protocol):
    """An input that is zero before t = 0."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times [s] at which the input or its slope jumps, increasing."""
        ...

    def piece(self, index: int) -> Signal:
        """Return the input between breaks ``index - 1`` and ``index``, smooth beyond its ends."""
        ...


def samples(waveform: Waveform, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a waveform at the times `t` [s], shape (n_samples,); at a jump, the value after it."""
    index = np.searchsorted(waveform.breaks, t, side="right")
    pieces = [waveform.piece(i) for i in range(len(waveform.breaks) + 1)]
    return np.array([pieces[i](float(time)) for i, time in zip(index, t, strict=True)])


def _silence(_: float) -> float:
    return 0.0


@dataclass(frozen=True)
class Sweep:
    """A logarithmic sweep from `omega_start` to `omega_stop` [rad/s] in `duration` [s]."""

    amplitude: float
    omega_start: float
    omega_stop: float
    duration: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """Its begin."""
        return (0.0,)

    def piece(self, index: int) -> Signal:
        """Return silence before the begin, the sweep after it."""
        if index == 0:
            return _silence
        growth = math.log(self.omega_stop / self.omega_start) / self.duration
        amplitude, phase = self.amplitude, self.omega_start / growth

        def sweep(t: float) -> float:
            return amplitude * math.sin(phase * math.expm1(growth * t))

        return sweep


@dataclass(frozen=True)
class Step:
    """Zero before `start` [s], `amplitude` from it on."""

    amplitude: float
    start: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """The jump."""
        return (self.start,)

    def piece(self, index: int) -> Signal:
        """Return the level before or after the jump."""
        level = self.amplitude * index
        return lambda _: level


@dataclass(frozen=True)
class Doublet:
    """Zero, then `amplitude` for `length` [s] from `start` [s] on, its opposite for as long, and zero again.

    A rig without restoring force is at rest again after it, not too far from where it was.
    """

    amplitude: float
    start: float
    length: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """The three jumps."""
        return tuple(self.start + i * self.length for i in range(3))

    def piece(self, index: int) -> Signal:
        """Return the level before, between or after the jumps."""
        level = (0.0, self.amplitude, -self.amplitude, 0.0)[index]
        return lambda _: level


@dataclass(frozen=True)
class PlannedMoves:
    """Rest, a move to `amplitude`, one to its opposite and one back, each of `length` [s] and with a rest as long behind it.

    Each move has the least jerk that one from rest to rest can have: what a trajectory generator gives a controller.

    References
    ----------
    T. Flash and N. Hogan, J. Neuroscience 5 (1985) 1688.
    """

    amplitude: float
    start: float
    length: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """Begin and end of the three moves."""
        return tuple(self.start + i * self.length for i in range(6))

    def piece(self, index: int) -> Signal:
        """Return a rest or a move."""
        levels = (0.0, self.amplitude, -self.amplitude, 0.0)
        moved, moving = divmod(index, 2)
        begin, here = self.start + (index - 1) * self.length, levels[moved]
        if not moving:
            return lambda _: here
        way, length = levels[moved + 1] - here, self.length

        def move(t: float) -> float:
            share = (t - begin) / length
            return here + way * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

        return move


@dataclass(frozen=True, eq=False)
class Multisine:
    """A sum of sines that fades in over `rise` [s], as a generator that protects a rig does it.

    Attributes
    ----------
    amplitudes, omega, phases
        Of each sine, shape (n_lines,).
    """

    amplitudes: NDArray[np.float64]
    omega: NDArray[np.float64]
    phases: NDArray[np.float64]
    rise: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """Begin and end of the rise."""
        return (0.0, self.rise)

    def piece(self, index: int) -> Signal:
        """Return silence, the rise, or the sum."""
        if index == 0:
            return _silence
        amplitudes, omega, phases, rise = self.amplitudes, self.omega, self.phases, self.rise

        def steady(t: float) -> float:
            return float(np.dot(amplitudes, np.cos(omega * t + phases)))

        def rising(t: float) -> float:
            return steady(t) * math.sin(0.5 * math.pi * t / rise) ** 2

        return rising if index == 1 else steady


@dataclass(frozen=True)
class Release:
    """`amplitude` until the time `at` [s], nothing from it on: what holds a rig away from its rest lets go."""

    amplitude: float
    at: float

    @property
    def breaks(self) -> tuple[float, ...]:
        """The moment of letting go."""
        return (self.at,)

    def piece(self, index: int) -> Signal:
        """Return the level before or after it."""
        level = 0.0 if index else self.amplitude
        return lambda _: level


class Disturbance:
    """Colored noise as a smooth function of time, from `start` [s] on.

    Parameters
    ----------
    values
        Equally spaced values, shape (n_values,).
    start, spacing
        Time of the first, and their distance [s].
    """

    def __init__(self, values: NDArray[np.float64], start: float, spacing: float) -> None:
        self.spline = CubicSpline(start + spacing * np.arange(values.size), values)
        self._rows = self.spline.c.T.tolist()
        self._start = start
        self._spacing = spacing

    def __call__(self, t: float) -> float:
        """Return the noise at a time [s]."""
        index = min(max(int((t - self._start) / self._spacing), 0), len(self._rows) - 1)
        c3, c2, c1, c0 = self._rows[index]
        tau = t - self._start - index * self._spacing
        return float(c0 + tau * (c1 + tau * (c2 + tau * c3)))


def low_pass_noise(
    size: float, corner: float, duration: float, rng: np.random.Generator, spacing: float = 0.02
) -> Disturbance:
    """Return a random signal of this standard deviation, white up to a corner, from rest at t = 0.

    Parameters
    ----------
    size
        Standard deviation.
    corner
        Angular frequency above which it falls [rad/s].
    duration
        How long it lasts [s].
    rng
        Source of randomness.
    spacing
        Distance of its values [s], small beside the reciprocal of the corner.
    """
    n_values = math.ceil(duration / spacing) + 4
    pole = math.exp(-corner * spacing)
    white = rng.normal(scale=size * math.sqrt(1.0 - pole**2), size=n_values)
    return Disturbance(lfilter([1.0], [1.0, -pole], np.r_[0.0, white[1:]]), 0.0, spacing)
