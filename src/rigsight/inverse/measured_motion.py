"""Smooth motion of a rig along a measured record, and what its equations leave of the forces there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, savgol_filter, sosfiltfilt

from rigsight.identify.rig_equations import FUNCTIONS, RigEquations, equations_of
from rigsight.identify.start.measured_states import measured_states, sensor_factors
from rigsight.records import Record
from rigsight.rigs import Rig, reading_symbol
from rigsight.simulate.prescribed_motion import accelerated_motion, smooth_motion

Floats = NDArray[np.float64]

_DEGREE = 5
"""Of the spline through the samples."""
_NEAR = 9
"""Samples through which a polynomial is laid for a derivative: exact to 1e-4 up to a ninth of the sample rate."""
_OF_MOTION = 0.99
"""Share of the power of all velocities below the end of the band of a motion."""
WIDER = 3.0
"""End of the band in which forces are compared, in units of that of the motion: forces hold overtones of it."""
_HIGHEST = 0.8
"""Share of the Nyquist frequency above which nothing is filtered."""
_ORDER = 4
_END = 1.5
"""Samples at the end of a record that the edge of the filter spoils, in half periods of the end of the band.

An assumption: at 1 the noise of the ends still dominates the rows of an arm, at 2 records of 240 samples lose what they show.
"""
_SMALL = 1e-3
"""Change of a state, in units of its deviation, from which its influence on the equations is taken."""
_AT_REST, _LARGE = 0.01, 98.0
"""Share of a large velocity (98th percentile) below which a velocity is noise and has no direction (an assumption)."""
_MOVES = 0.5
"""Share of the length of the filter in which a coordinate must move for its row to count: most of it (a convention)."""
_ABOVE = 1.2
"""Sampling rate of filtered rows, in units of twice the end of their band."""


@dataclass(frozen=True, eq=False)
class RecordMotion:
    """States, accelerations and inputs of a rig along one record.

    Attributes
    ----------
    equations
        Of the rig.
    record
        The record, with every input of the rig.
    z, a, u
        States (n_states, n_samples), second derivatives of the coordinates (n_coordinates, n_samples) and inputs with their
        derivatives (3 n_inputs, n_samples).
    is_integrated
        Whether a coordinate is the integral of a reading, so that its zero and what is slower than the motion are not known.
    drifts
        Whether the equations read such a coordinate.
    """

    equations: RigEquations
    record: Record
    z: Floats
    a: Floats
    u: Floats
    is_integrated: bool = False
    drifts: bool = False

    @property
    def sensors(self) -> list[int]:
        """Numbers of the sensors that the record holds."""
        names = self.equations.sensor_names
        return [number for number, name in enumerate(names) if name in self.record]

    def residual(self, values: Mapping[str, float]) -> Floats:
        """Return what the equations of motion need beside their forces, shape (n_equations, n_samples).

        Where every motion is prescribed: the model of each force less its reading.

        Parameters
        ----------
        values
            Constants and parameters by name.
        """
        p = self.equations.parameters(values, self.record)
        if self.equations.n_coordinates:
            missing = self.a - self.equations.accelerations(self.z, self.u, p)
            return np.asarray(np.einsum("kij,jk->ik", self.equations.mass(self.z, self.u, p), missing))
        shown = self.equations.readings(self.z, self.u, p)
        return np.array([shown[i] - self.record[self.equations.sensor_names[i]] for i in self.sensors])

    def slopes(self, values: Mapping[str, float], names: Sequence[str]) -> Floats:
        """Return the derivatives of `residual` by parameters, shape (n_names, n_equations, n_samples).

        Parameters
        ----------
        values
            Constants and parameters by name.
        names
            The parameters.
        """
        equations = self.equations
        p = equations.parameters(values, self.record)
        rows = equations.changes_of_equations(self.z, self.u, p, self.a)[1]
        n, n_own = equations.n_coordinates, equations.n_states - 2 * equations.n_coordinates
        chosen = list(range(n)) if n else [n_own + i for i in self.sensors]
        columns = [equations.structure.names.index(name) for name in names]
        return np.moveaxis(rows[chosen][:, columns], 0, 1)

    def forces(self, values: Mapping[str, float]) -> tuple[Floats, ...]:
        """Return the forces of inertia and of the drives in each equation, shape (n_equations, n_samples) each.

        Where every motion is prescribed: the reading of each force.

        Parameters
        ----------
        values
            Constants and parameters by name.
        """
        equations, p = self.equations, self.equations.parameters(values, self.record)
        if not equations.n_coordinates:
            return (np.array([self.record[equations.sensor_names[i]] for i in self.sensors]),)
        inertia = np.einsum("kij,jk->ik", equations.mass(self.z, self.u, p), self.a)
        along = equations.slopes_along(self.z, self.u, p)
        given = equations.at_places(self.z, self.u, p)
        drives = equations.rig.mechanism.drives
        driven = sum((along[d.name] * given[f"force@{d.name}"] for d in drives), np.zeros_like(inertia))
        return np.asarray(inertia), np.asarray(driven)

    def along(self, expression: sp.Expr, values: Mapping[str, float]) -> Floats:
        """Return an expression of the rig along the motion, with inputs and readings as they are recorded, shape (n_samples,).

        It is not a number where it reads what the record does not hold.

        Parameters
        ----------
        expression
            As declared, without forces of joints.
        values
            Constants and parameters by name.
        """
        mechanism, record, n = self.equations.rig.mechanism, self.record, self.equations.n_coordinates
        drives = {sp.Symbol(drive.name, real=True): drive.signal for drive in mechanism.drives}
        declared = mechanism.written_out(mechanism.written_out(expression).xreplace(drives))
        numbers = {**values, **record.constants}
        signals: dict[sp.Symbol, Floats | float] = {sp.Symbol(k, real=True): v for k, v in numbers.items()}
        signals |= {sp.Symbol(name, real=True): record[name] for name in mechanism.inputs}
        signals |= {reading_symbol(s.name): record[s.name] for s in mechanism.sensors if s.name in record}
        for i, c in enumerate(mechanism.free):
            signals |= {c.symbol: self.z[i], c.rate: self.z[n + i]}
        for i, c in enumerate(mechanism.prescribed):
            signals |= {c.symbol: self.u[3 * i], c.rate: self.u[3 * i + 1]}
        read = tuple(sorted(declared.free_symbols, key=str))
        if not signals.keys() >= set(read):
            return np.full(record.n_samples, np.nan)
        found = sp.lambdify(read, declared, [FUNCTIONS, "numpy"])(*(signals[symbol] for symbol in read))
        return np.array(np.broadcast_to(found, record.n_samples), dtype=np.float64)

    def with_reading_changed(
        self, name: str, change: Floats, values: Mapping[str, float], rate: Floats | None = None
    ) -> tuple[Floats, Floats] | None:
        """Return the changes of `z` and `a` by small changes of one reading; None where it reads no coordinate or rate alone.

        Changes, shape (.., n_samples), are smooth: they are differentiated as they are, unless their `rate` is known.
        """
        equations, n, dt = self.equations, self.equations.n_coordinates, self.record.dt
        p = equations.parameters(values, self.record)
        slopes = equations.readings_by_state(self.z, self.u, p)[self.sensors]
        own = [equations.sensor_names[i] for i in self.sensors].index(name)
        reads_place, reads_rate = np.any(slopes[own, :n]), np.any(slopes[own, n : 2 * n])
        if reads_place == reads_rate or np.any(slopes[own, 2 * n :]):
            return None
        first = 0 if reads_place else n
        of_sensors = np.moveaxis(slopes[:, first : first + n], 2, 0)
        if not np.any(np.ptp(of_sensors, axis=0)):
            of_sensors = of_sensors[:1]
        pinv = np.linalg.pinv(of_sensors)[:, :, own].T
        by_reading = pinv * change[..., None, :]
        z = np.zeros((*change.shape[:-1], *self.z.shape))
        z[..., first : first + n, :] = by_reading
        if reads_place:
            z[..., n : 2 * n, :] = slope(by_reading, dt)
            if rate is not None:
                z[..., n : 2 * n, :] += pinv * (rate - slope(change, dt))[..., None, :]
        else:
            z[..., :n, :] = cumulative_trapezoid(by_reading, dx=dt, initial=0)
        return z, slope(z[..., n : 2 * n, :], dt)

    def ahead(self, time: float) -> tuple[Floats, Floats]:
        """Return the changes of `z` and `a` if the whole motion were ahead by so much time."""
        # Speeds by themselves: a position that stands still beyond the end of the record would stop there.
        n, dt = self.equations.n_coordinates, self.record.dt
        change = np.array([shifted(row, dt, time) - row for row in self.filtered(self.z)])
        return change, slope(change[n : 2 * n], dt)

    def by_motion(self, values: Mapping[str, float]) -> Floats:
        """Return the derivatives of `residual` by `z` and `a`, shape (n_equations, n_states + n_coordinates, n_samples).

        Parameters
        ----------
        values
            Constants and parameters by name.
        """
        equations, now = self.equations, self.residual(values)
        columns = []
        for i, row in enumerate(self.z):
            step = _SMALL * float(np.std(row)) or _SMALL
            moved = replace(self, z=np.concatenate([self.z[:i], row[None] + step, self.z[i + 1 :]]))
            columns.append((moved.residual(values) - now) / step)
        p = equations.parameters(values, self.record)
        masses = np.moveaxis(equations.mass(self.z, self.u, p), 0, 2)
        return np.concatenate([np.array(columns).swapaxes(0, 1), masses], axis=1)

    @cached_property
    def band(self) -> float:
        """End of the band in which forces are compared, in units of the Nyquist frequency."""
        return WIDER * self._slower_than(_OF_MOTION)

    def _slower_than(self, share: float) -> float:
        """Return the frequency below which there is a share of the power of all velocities, in units of the Nyquist frequency."""
        n = self.equations.n_coordinates
        speeds = self.z[n : 2 * n] if n else self.u[1::3]
        power = np.sum(np.abs(np.fft.rfft(speeds * np.hanning(speeds.shape[1]))) ** 2, axis=0)
        below = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
        return float(2.0 * (np.searchsorted(below, share) + 1) / speeds.shape[1])

    @cached_property
    def _filter(self) -> Floats:
        return np.asarray(butter(_ORDER, self.band, output="sos"))

    @cached_property
    def _slow_filter(self) -> Floats:
        slowest = self._slower_than(1.0 - _OF_MOTION) / WIDER
        return np.asarray(butter(_ORDER // 2, slowest, "highpass", output="sos"))

    def filtered(self, rows: Floats) -> Floats:
        """Return rows (.., n_samples) without what is faster than the motion and, where it drifts, without what is slower."""
        if self.drifts and rows.shape[-1] >= 10 * _ORDER:
            rows = sosfiltfilt(self._slow_filter, rows, axis=-1, padtype="even")
        return self.smoothed(rows)

    def smoothed(self, rows: Floats) -> Floats:
        """Return rows (.., n_samples) without what is faster than the motion."""
        if rows.shape[-1] < 10 * _ORDER or self.band >= _HIGHEST:
            return rows
        # Mirrored: an odd continuation would turn about the first sample, whose acceleration is the noisiest.
        return np.asarray(sosfiltfilt(self._filter, rows, axis=-1, padtype="even"))

    def inner(self, rows: Floats) -> Floats:
        """Return filtered rows without the ends of the record, where neither acceleration nor filter has both sides."""
        return self._inside(self.filtered(rows))

    def _inside(self, rows: Floats) -> Floats:
        n_end = self._n_end
        return rows[..., n_end : rows.shape[-1] - n_end]

    @property
    def _n_end(self) -> int:
        return min(max(1, int(_END / self.band)), self.record.n_samples // 10)

    def known_ahead(self, time: float) -> Floats:
        """Return 1 at the samples at which the motion so much later is inside of the record, else 0, shape (n_samples,).

        What is ahead is filtered twice, as motion and as a row, so that the end that this spoils is twice as long.
        """
        later, n = np.arange(self.record.n_samples) + time / self.record.dt, self.record.n_samples
        inside = later < n - 2 * self._n_end if time > 0.0 else later >= 2 * self._n_end
        return np.asarray(inside, dtype=np.float64)

    @cached_property
    def row_weights(self) -> Floats:
        """Weight of each inner row of an equation (n_equations or 1, n_rows), RMS one: zero where its coordinate stands still.

        There dry friction holds any force up to its limit, and the equation says nothing. A prescribed motion leaves no such
        force open.
        """
        n = self.equations.n_coordinates
        speeds = np.abs(self.z[n : 2 * n])
        moves = [speed >= speed_at_rest(speed) for speed in speeds] or [np.ones(self.record.n_samples)]
        moving = self._inside(self.smoothed(np.array(moves, dtype=np.float64))) > _MOVES
        moving |= ~np.any(moving, axis=1, keepdims=True)
        return np.asarray(moving / np.sqrt(np.mean(moving, axis=1, keepdims=True)))

    def where_moving(self, rows: Floats) -> Floats:
        """Return inner filtered rows of equations (.., n_equations, n_samples), zero where the coordinate stands still."""
        return np.asarray(self.inner(rows) * self.row_weights)

    def thinned(self, rows: Floats) -> Floats:
        """Return inner filtered rows at those samples only that are nearly independent."""
        return self.some(self.filtered(rows))

    def some(self, filtered: Floats) -> Floats:
        """Return these samples of rows that are filtered already."""
        return self._inside(filtered)[..., :: self.stride]

    @property
    def stride(self) -> int:
        """Samples from one of these to the next."""
        return max(1, int(1.0 / (_ABOVE * self.band)))


def nearest_force(along: Floats, rows: Floats) -> Floats:
    """Return the force that explains most of rows of equations, shape (n_samples,).

    Parameters
    ----------
    along
        What a unit of the force adds to each equation, shape (n_equations, n_samples).
    rows
        Of the equations, of the same shape.
    """
    size = np.maximum(np.sum(along**2, axis=0), np.finfo(np.float64).tiny)
    return np.asarray(np.sum(along * rows, axis=0) / size)


def speed_at_rest(speed: Floats) -> float:
    """Return the size up to which a speed along a record is noise and has no direction."""
    return _AT_REST * float(np.percentile(np.abs(speed), _LARGE))


def record_motion(rig: Rig, record: Record, values: Mapping[str, float]) -> RecordMotion | None:
    """Return the motion of a rig along a record, or None if its sensors do not show it.

    Parameters
    ----------
    rig
        The rig.
    record
        Measured; an input that it does not hold is zero.
    values
        Constants and parameters; sensors must not depend on other ones.
    """
    equations = equations_of(rig)
    still = {s.name: np.zeros(record.n_samples) for s in rig.inputs if s.name not in record}
    complete = record.with_signals(**still) if still else record
    u = equations.inputs_of(complete)[1].copy()
    if complete.hold == "zoh":
        # A held input steps at each sample: the smooth motion follows the mean of both sides.
        u[::3, 1:] = (u[::3, :-1] + u[::3, 1:]) / 2.0
    n = equations.n_coordinates
    if not equations.n_states:
        nothing = np.zeros((0, record.n_samples))
        return RecordMotion(equations, complete, nothing, nothing, u)
    unknown = frozenset(p.name for p in rig.parameters if p.name not in values)
    filled = {**{p.name: 1.0 for p in rig.parameters}, **values}
    p, factors = equations.parameters(filled, complete), sensor_factors(equations, unknown)
    # What a sensor shows at rest: its zero, and what it reads of the inputs.
    at_rest = equations.readings(np.zeros((equations.n_states, record.n_samples)), u, p)
    shown = {
        name: record[name] - rest
        for name, rest in zip(equations.sensor_names, at_rest, strict=False)
        if name in factors and name in record and np.all(np.isfinite(rest))
    }
    found = measured_states(equations, complete.with_signals(**shown), p, factors)
    if found is None:
        return None
    z, a = found.z.copy(), np.zeros((n, record.n_samples))
    for i in range(n):
        if np.any(found.by_integral[i]):
            z[n + i], a[i] = smooth_motion(z[n + i], record.dt)
        else:
            z[i], z[n + i], a[i] = accelerated_motion(z[i], record.dt)
    motion = RecordMotion(equations, complete, z, a, u)
    by_place = motion.by_motion(filled)[:, :n] if found.is_integrated else np.zeros(0)
    return replace(motion, is_integrated=found.is_integrated, drifts=bool(np.any(by_place)))


def along_change(by_motion: Floats, change: tuple[Floats, Floats]) -> Floats:
    """Return the change of the equations by small changes of `z` and `a`, shape (.., n_equations, n_samples)."""
    return np.asarray(np.einsum("ekt,...kt->...et", by_motion, np.concatenate(change, axis=-2)))


def shifted(signal: Floats, dt: float, ahead: float) -> Floats:
    """Return a signal, shape (n_samples,), at times that are ahead by so much; beyond its ends it stays as it is."""
    time = np.arange(signal.size) * dt
    smooth = make_interp_spline(time, signal, k=min(_DEGREE, signal.size - 1))
    return np.asarray(smooth(np.clip(time + ahead, 0.0, time[-1])))


def slope(rows: Floats, dt: float) -> Floats:
    """Return the derivative of rows, shape (.., n_samples), with respect to time."""
    n = rows.shape[-1]
    near = min(_NEAR, n - 1 + n % 2)
    return np.asarray(savgol_filter(rows, near, near - 1, deriv=1, delta=dt, axis=-1))
