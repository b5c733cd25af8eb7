"""What the sensors of a record measure of the states of a rig, and on which spectral lines.

A coordinate is measured by a sensor that reads it or, up to a constant, its rate. Sensors whose reading is not a sum of such
quantities with known factors are not used here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import null_space

from rigsight.effects.symbols import derivative
from rigsight.identify.rig_equations import RigEquations
from rigsight.records.record import Floats, Record
from rigsight.simulate.prescribed_motion import smooth_motion

_RANK = 1e-9
"""Share of the largest singular value below which a combination of states is not shown."""

_HIDDEN, _WAVES = 0.7, 20
"""Size of an unmeasured motion relative to a measured one, and its number of periods if none is measured."""
Complexes = NDArray[np.complex128]
_STRETCHES = 4
"""Length of a record in units of a stretch; stretches overlap by half."""
_SHORTEST = 64
"""Smallest number of samples of a stretch."""
SIGNIFICANT_POWER = 25.0
"""Power over that of the noise above which a line of a sensor is informative."""
_BAND_OF_SUMS = 0.5
"""Share of the band below half the sampling rate in which sums approximate the integrals."""
_LEAST_NOISE = 1e-6
"""Noise assumed for a sensor without visible noise, relative to its size."""


@dataclass(frozen=True)
class MeasuredStates:
    """States of a rig measured by its sensors."""

    # Shape (n_states, n_samples), in the order of `RigEquations`; offsets of the readings are not removed.
    z: Floats
    # Factors of each sensor's reading, and of its integral, in each coordinate and own state: shape
    # (n_coordinates + n_own, n_sensors), columns in the order of the rig's sensors.
    by_reading: Floats
    by_integral: Floats

    @property
    def is_integrated(self) -> bool:
        """Whether a coordinate is known only up to a constant."""
        return bool(np.any(self.by_integral))


def sensor_factors(equations: RigEquations, free: frozenset[str]) -> dict[str, tuple[sp.Expr, ...]]:
    """Return the factors of the states in each reading that is a sum of them, by sensor."""
    structure = equations.structure
    unknown = {
        symbol
        for name, symbol in zip(structure.names, structure.parameter_symbols, strict=True)
        if name in free
    }
    given = set(structure.parameter_symbols) - unknown
    found = {}
    for name, reading in zip(equations.sensor_names, structure.outputs, strict=False):
        factors = tuple(derivative(reading, state) for state in structure.states)
        if all(factor.free_symbols <= given for factor in factors):
            found[name] = factors
    return found


def measured_states(
    equations: RigEquations, record: Record, p: Floats, factors: Mapping[str, Sequence[sp.Expr]]
) -> MeasuredStates | None:
    """Return the states of a record, or None if its sensors do not show them all."""
    n, n_states = equations.n_coordinates, equations.n_states
    n_own, n_sensors = n_states - 2 * n, len(equations.sensor_names)
    numbers = dict(zip(equations.structure.parameter_symbols, map(float, p), strict=True))
    names = [name for name in equations.sensor_names if name in factors and name in record]
    if not names:
        return None
    rows = np.array([[float(f.xreplace(numbers)) for f in factors[name]] for name in names])
    position, rate, own = rows[:, :n], rows[:, n : 2 * n], rows[:, 2 * n :]
    y = np.array([record[name] for name in names])
    columns = [equations.sensor_names.index(name) for name in names]
    of_rate = np.any(rate != 0.0, axis=1)
    of_own = np.any(own != 0.0, axis=1)
    direct = ~of_rate & ~of_own
    by_reading, by_integral = np.zeros((n + n_own, n_sensors)), np.zeros((n + n_own, n_sensors))
    shown = np.linalg.pinv(position[direct], rcond=_RANK) if np.any(direct) else np.zeros((n, 0))
    smooth = np.array([smooth_motion(signal, record.dt)[1] for signal in y[direct]]).reshape(-1, y.shape[1])
    q, v = shown @ y[direct], shown @ smooth
    by_reading[:n, np.array(columns)[direct]] = shown
    hidden = null_space(position[direct], rcond=_RANK) if np.any(direct) else np.eye(n)
    if hidden.shape[1] > 0:
        through = of_rate & ~of_own & np.all(position == 0.0, axis=1)
        speeds = rate[through] @ hidden
        if np.linalg.matrix_rank(speeds) < hidden.shape[1]:
            return None
        back = hidden @ np.linalg.pinv(speeds)
        slope = back @ (y[through] - rate[through] @ v)
        moved = cumulative_trapezoid(slope, dx=record.dt, axis=1, initial=0)
        q, v = q + moved - np.mean(moved, axis=1, keepdims=True), v + slope
        by_integral[:n, np.array(columns)[through]] = back
    x = np.zeros((n_own, y.shape[1]))
    if n_own:
        if np.linalg.matrix_rank(own[of_own]) < n_own:
            return None
        back = np.linalg.pinv(own[of_own])
        x = back @ (y[of_own] - position[of_own] @ q - rate[of_own] @ v)
        by_reading[n:, np.array(columns)[of_own]] = back
    return MeasuredStates(np.concatenate([q, v, x]), by_reading, by_integral)


def supposed_states(
    equations: RigEquations, record: Record, p: Floats, factors: Mapping[str, Sequence[sp.Expr]]
) -> MeasuredStates:
    """Return states of plausible size, if sensors do not show them all: derived from other states with the same unit."""
    mechanism, n = equations.rig.mechanism, equations.n_coordinates
    numbers = dict(zip(equations.structure.parameter_symbols, map(float, p), strict=True))
    units = [*(c.unit for c in mechanism.free), *(s.unit for s in mechanism.states)]
    places = [*range(n), *range(2 * n, equations.n_states)]
    own: dict[int, Floats] = {}
    for name in equations.sensor_names:
        if name not in factors or name not in record:
            continue
        row = np.array([float(f.xreplace(numbers)) for f in factors[name]])
        signal = record[name] - np.mean(record[name])
        for index, place in enumerate(places):
            if row[place] != 0.0:
                own.setdefault(index, signal / row[place])
            elif index < n and row[n + index] != 0.0:
                moved = cumulative_trapezoid(signal / row[n + index], dx=record.dt, initial=0)
                own.setdefault(index, moved - np.mean(moved))
    # Not equal to another state, so that a joint between the two moves as well.
    others = {units[index]: _HIDDEN * signal for index, signal in reversed(own.items())}
    wave = np.sin(2.0 * np.pi * _WAVES * np.arange(record.n_samples) / record.n_samples)
    signals = np.array([own.get(i, others.get(unit, wave)) for i, unit in enumerate(units)])
    rates = np.gradient(signals[:n], record.dt, axis=1) if n else signals[:n]
    nothing = np.zeros((len(units), len(equations.sensor_names)))
    return MeasuredStates(np.concatenate([signals[:n], rates, signals[n:]]), nothing, nothing)


@dataclass(frozen=True)
class Projection:
    """Integrals of signals times a window and ``e^{-j omega t}`` over stretches of a record."""

    omega: Floats  # angular frequencies [rad/s], shape (n_points,)
    # Index of the stretch and of the line of each point, shape (n_points,).
    stretch: NDArray[np.intp]
    line: NDArray[np.intp]
    # First samples of the stretches, and their number of samples.
    starts: NDArray[np.intp]
    length: int
    dt: float  # sample time [s]

    def of(self, signal: Floats) -> Complexes:
        """Return the integrals of a signal."""
        return self._lines(signal, np.sin(np.pi * np.arange(self.length) / self.length) ** 2)

    def of_rate(self, signal: Floats) -> Complexes:
        """Return the integrals of the derivative of a signal, by integration by parts."""
        phase, rate = 2.0 * np.pi * np.arange(self.length) / self.length, np.pi / (self.length * self.dt)
        return 1j * self.omega * self.of(signal) - self._lines(signal, rate * np.sin(phase))

    def _lines(self, signal: Floats, window: Floats) -> Complexes:
        cut = signal[self.starts[:, None] + np.arange(self.length)] * window
        return np.asarray(np.fft.rfft(cut, axis=1)[self.stretch, self.line])


def projected(
    equations: RigEquations, record: Record, measured: MeasuredStates, most: int
) -> tuple[Projection, Floats]:
    """Return the projection on informative lines, and the power of each sensor's noise on a line, shape (n_sensors,)."""
    n_samples = record.n_samples
    length = min(max(n_samples // _STRETCHES, _SHORTEST), n_samples)
    starts = np.unique(np.linspace(0, n_samples - length, max(1, 2 * n_samples // length - 1)).astype(int))
    stretch, line = (a.ravel() for a in np.indices((starts.size, length // 2 + 1)))
    omega: Floats = np.asarray(2.0 * np.pi * line / (length * record.dt), dtype=np.float64)
    every = Projection(omega, stretch, line, starts, length, record.dt)
    floors = np.zeros(len(equations.sensor_names))
    says = np.zeros(omega.size, dtype=bool)
    for i, name in enumerate(equations.sensor_names):
        if name in record:
            power = np.abs(every.of(record[name] - np.mean(record[name]))) ** 2
            quiet = power[line > 0.9 * (length // 2)]
            floors[i] = max(float(np.median(quiet)) / np.log(2.0), (_LEAST_NOISE**2) * float(np.mean(power)))
            says |= power > SIGNIFICANT_POWER * floors[i]
    for source in equations.rig.inputs:
        power = np.abs(every.of(record[source.name] - np.mean(record[source.name]))) ** 2
        says |= power > SIGNIFICANT_POWER * _LEAST_NOISE * np.max(power)
    # The first two lines of a signal that is known only up to a constant are not used; the window spreads the constant over them.
    first = 2 if measured.is_integrated else 0
    kept = np.flatnonzero(says & (line >= first) & (omega < _BAND_OF_SUMS * np.pi / record.dt))
    if kept.size == 0:
        kept = np.flatnonzero((line >= first) & (omega < _BAND_OF_SUMS * np.pi / record.dt))
    kept = kept[:: max(1, kept.size // most)]
    return Projection(omega[kept], stretch[kept], line[kept], starts, length, record.dt), floors
