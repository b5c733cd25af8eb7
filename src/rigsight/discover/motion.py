"""Motion of the mass and the missing force in a record, and rows of a regression from them.

Motion: Kalman filter and Rauch-Tung-Striebel smoother with the known input. The linear equations of the rig are the model; the
missing force is an additional state, an integrated random walk. Its intensity is estimated by maximum likelihood, so that the
records determine how fast the force may change.

Rows: integrals over windows with smooth test functions (the weak form), or single points. Derivatives are moved to the test
function by integration by parts, so that measured signals are not differentiated.

References
----------
H. E. Rauch, F. Tung and C. T. Striebel, AIAA J. 3 (1965) 1445; C. F. Van Loan, IEEE Trans. Autom. Control 23 (1978) 395, for
the discrete noise; D. A. Messenger and D. M. Bortz, "Weak SINDy", Multiscale Model. Simul. 19 (2021) 1474.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion

_DECADES = (-4.0, -2.0, 0.0, 2.0, 4.0, 6.0)
"""Intensities tried, in decades relative to that of a missing force that grows as large as the spring's within one radian."""
_BETWEEN = (-1.0, 1.0)
_LONGEST_TRIAL = 3000
_SETTLING = 20


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed motion of one record about its rest position, shape (n_samples,) each."""

    record: Record  # the measured record
    x: Floats  # displacement
    v: Floats  # velocity
    acceleration: Floats
    u: Floats  # input; the displacement if the motion is prescribed
    measured: Floats  # what is regressed: displacement, or force if the motion is prescribed

    @property
    def dt(self) -> float:
        """Sample time [s]."""
        return self.record.dt


class _Carrier:
    """The linear model of the smoother: ``m x'' = g u - k (x - rest) - d x' + missing force``."""

    def __init__(self, rig: Rig, values: Mapping[str, float]) -> None:
        motion = rig.motion
        self.inertia, self.damping, self.stiffness, self.gain, self.rest = (
            evaluated(part, values)
            for part in (motion.inertia, motion.damping, motion.stiffness, motion.drive_gain, motion.rest)
        )


def motion_of(rig: Rig, record: Record, values: Mapping[str, float], noise: float) -> Motion:
    """Return the smoothed motion of a record."""
    source, response = record[rig.inputs[0].name], record[rig.outputs[0].name]
    if not rig.is_driven:
        x, v = smooth_motion(source, record.dt)
        return Motion(record, x, v, np.gradient(v, record.dt), x, response)
    carrier = _Carrier(rig, values)
    smoother = _Smoother(carrier, record.dt, record.hold == "zoh", noise**2)
    displacement = response - carrier.rest
    intensity = smoother.likeliest(displacement[:_LONGEST_TRIAL], source[:_LONGEST_TRIAL])
    states = smoother.smoothed(displacement, source, intensity)
    x, v, missing = states[:, 0], states[:, 1], states[:, 2]
    forces = carrier.gain * source - carrier.damping * v - carrier.stiffness * x + missing
    return Motion(record, x, v, forces / carrier.inertia, source, displacement)


class _Smoother:
    """Steady-state filter and smoother of displacement, velocity, missing force and its rate."""

    def __init__(self, carrier: _Carrier, dt: float, held: bool, variance: float) -> None:
        self._carrier, self._dt, self._variance = carrier, dt, variance
        m, d, k = carrier.inertia, carrier.damping, carrier.stiffness
        rates = np.array([[0, 1, 0, 0], [-k / m, -d / m, 1 / m, 0], [0, 0, 0, 1], [0, 0, 0, 0]], dtype=float)
        driven = np.zeros((6, 6))
        driven[:4, :4], driven[1, 4], driven[4, 5] = rates, carrier.gain / m, 1.0
        step = expm(driven * dt)
        self._transition, self._level = step[:4, :4], step[:4, 4]
        self._slope = np.zeros(4) if held else step[:4, 5]
        doubled = np.zeros((8, 8))
        doubled[:4, :4], doubled[4:, 4:], doubled[3, 7] = -rates, rates.T, 1.0
        parts = expm(doubled * dt)
        noise = parts[4:, 4:].T @ parts[:4, 4:]
        self._noise = (noise + noise.T) / 2.0
        # Units in which every state changes by about one within a sample time: in SI the Riccati equation is badly scaled.
        self._units = np.array([1.0, 1.0 / dt, m / dt**2, m / dt**3])

    def likeliest(self, x: Floats, u: Floats) -> float:
        """Return the intensity of the missing force's second derivative that makes the displacement most likely."""
        carrier = self._carrier
        size = float(np.std(x)) or 1.0
        omega = np.sqrt(max(carrier.stiffness, 1e-12) / carrier.inertia)
        omega = max(omega, 2.0 * np.pi / (x.size * self._dt))
        unit = (carrier.inertia * omega**2 * size * omega**2) ** 2 / omega

        def cost(decade: float) -> float:
            gain, variance, _ = self._gains(unit * 10.0**decade)
            _, _, errors = self._filtered(x, u, gain)
            return float(np.mean(errors[_SETTLING:] ** 2)) / variance + float(np.log(variance))

        coarse = min(_DECADES, key=cost)
        return float(unit * 10.0 ** min((coarse, *(coarse + step for step in _BETWEEN)), key=cost))

    def smoothed(self, x: Floats, u: Floats, intensity: float) -> Floats:
        """Return the four states, shape (n_samples, 4)."""
        gain, _, back = self._gains(intensity)
        predicted, filtered, _ = self._filtered(x, u, gain)
        states = filtered.copy()
        for i in range(x.size - 2, -1, -1):
            states[i] += back @ (states[i + 1] - predicted[i + 1])
        return states

    def _gains(self, intensity: float) -> tuple[Floats, float, Floats]:
        units = self._units
        seen = np.array([[1.0, 0.0, 0.0, 0.0]])
        transition = self._transition * (units[None, :] / units[:, None])
        noise = intensity * self._noise / np.outer(units, units) / self._variance
        spread = solve_discrete_are(transition.T, seen.T, noise, np.eye(1))
        gain = spread[:, 0] / (spread[0, 0] + 1.0)
        after = spread - np.outer(gain, spread[0])
        back = np.linalg.solve(spread, transition @ after).T
        return gain * units, float((spread[0, 0] + 1.0) * self._variance), back * np.outer(units, 1.0 / units)

    def _filtered(self, x: Floats, u: Floats, gain: Floats) -> tuple[Floats, Floats, Floats]:
        n = x.size
        driven = np.outer(u[:-1], self._level) + np.outer(np.diff(u) / self._dt, self._slope)
        predicted, filtered, errors = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros(n)
        state = np.array([np.mean(x[:5]), 0.0, 0.0, 0.0])
        for i in range(n):
            predicted[i] = state
            errors[i] = x[i] - state[0]
            filtered[i] = state + gain * errors[i]
            if i < n - 1:
                state = self._transition @ filtered[i] + driven[i]
        return predicted, filtered, errors


_POWER = 5
"""Of the test function (1 - s^2)^p; its first four derivatives vanish at the ends of the window."""
_ROWS_PER_WINDOW = 4
_LEAST_WIDTH = 11


@dataclass(frozen=True, eq=False)
class Windows:
    """Test functions for one sample time."""

    # Test function and its first two derivatives with respect to time, integration weights included, shape (3, width).
    weights: Floats
    step: int  # samples from row to row

    def against(self, signal: Floats, order: int) -> Floats:
        """Return the integrals of a signal with the test function or one of its derivatives, shape (n_rows,).

        There are none if the signal is shorter than a window.
        """
        if signal.size < self.weights.shape[1]:
            # numpy would exchange the two, and slide the signal along the test function.
            return np.zeros(0)
        return np.asarray(np.correlate(signal, self.weights[order], "valid")[:: self.step])


@dataclass(frozen=True)
class Rows:
    """How signals of records, each with its own sample time, are turned into rows."""

    width: float | None  # width of the windows [s]; None for point-wise rows
    step: int = 1  # samples from row to row of point-wise rows

    def of(self, signal: Floats, dt: float) -> Floats:
        """Return the rows of a signal of shape (n_samples,)."""
        return signal[:: self.step] if self.width is None else windows(self.width, dt).against(signal, 0)

    def rate_of(self, signal: Floats, dt: float) -> Floats:
        """Return the rows of the derivative of a signal."""
        if self.width is None:
            return np.asarray(np.gradient(signal, dt)[:: self.step])
        return -windows(self.width, dt).against(signal, 1)

    def velocity(self, motion: Motion) -> Floats:
        """Return the rows of the velocity."""
        if self.width is None:
            return motion.v[:: self.step]
        return -windows(self.width, motion.dt).against(motion.x, 1)

    def acceleration(self, motion: Motion) -> Floats:
        """Return the rows of the acceleration."""
        if self.width is None:
            return motion.acceleration[:: self.step]
        return windows(self.width, motion.dt).against(motion.measured, 2)

    def independent_share(self, order: int, dt: float) -> float:
        """Return the number of independent rows per row, less than 1 if windows overlap."""
        if self.width is None:
            return 1.0
        found = windows(self.width, dt)
        own = found.weights[order]
        products = np.correlate(own, own, "full") / np.sum(own**2)
        lags = products[own.size - 1 :: found.step][1:]
        return float(1.0 / (1.0 + 2.0 * np.sum(lags**2)))


@lru_cache(maxsize=64)
def windows(width: float, dt: float) -> Windows:
    """Return test functions of a width [s] at a sample time."""
    half = max(round(width / dt), _LEAST_WIDTH) // 2
    s = np.arange(-half, half + 1) / (half + 1)
    rate = 1.0 / ((half + 1) * dt)
    inside = 1.0 - s**2
    value = inside**_POWER
    slope = -2.0 * _POWER * s * inside ** (_POWER - 1) * rate
    bend = 2.0 * _POWER * inside ** (_POWER - 2) * (2.0 * (_POWER - 1) * s**2 - inside) * rate**2
    # Rows of unit integral, so that a row is the mean of a signal over its window.
    weights = np.array([value, slope, bend]) / np.sum(value)
    weights.setflags(write=False)
    return Windows(weights, max(1, (2 * half + 1) // _ROWS_PER_WINDOW))
