"""Does the lateral part follow from the measured motion? Its linear equation is fitted with the measured motion as input.

``y' = b (c + g x(t + shift) - y)`` with x joined by straight lines. For each rate b and shift, gain g, offset c and initial
values follow by linear least squares, so that the search has two dimensions at most. Errors of the model of x do not matter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize
import scipy.signal
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rigsight.diagnose.fitting.fit_context import FitContext
from rigsight.diagnose.policy import MAPS
from rigsight.effects.symbols import derivative
from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class LateralLeg:
    """The section from the measured motion to y."""

    # Residual of y per scored record, shape (n_samples,): as given, with the best numbers, and with the
    # motion shifted too.
    given: tuple[NDArray[np.float64], ...]
    fitted: tuple[NDArray[np.float64], ...]
    shifted: tuple[NDArray[np.float64], ...]
    # How much earlier the motion must have come for the best fit [s], and its standard error from a white
    # residual.
    shift: float
    shift_std: float
    noise_gain: float  # gain from the noise of the motion to y, [unit of y per unit of x]


@dataclass(frozen=True)
class _Numbers:
    rate: float
    gain: float
    offset: float
    shift: float = 0.0


def fit_lateral_leg(context: FitContext, given: Mapping[str, float]) -> LateralLeg | None:
    """Fit the lateral equation with the measured motion as input; None where no record holds both."""
    rig = context.rig
    if rig.follower is None:
        return None
    names = (rig.outputs[0].name, rig.follower.symbol.name)
    fitted_to = [r for r in context.estimation if names[1] in r]
    scored_on = [r for r in context.scoring if names[1] in r]
    if not fitted_to or not scored_on:
        return None
    start = _given(rig, given)
    longest = max(r.duration for r in fitted_to)
    lowest, highest = np.log(MAPS.slowest_rate / longest), np.log(MAPS.fastest_rate / fitted_to[0].dt)
    first = float(np.clip(np.log(start.rate), lowest + 1e-6, highest - 1e-6))

    def residual(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        shift = float(theta[1]) * fitted_to[0].dt if theta.size > 1 else 0.0
        return _projected(fitted_to, names, float(np.exp(theta[0])), shift)[0]

    plain = scipy.optimize.least_squares(residual, [first], bounds=([lowest], [highest]), x_scale=0.1)
    reach = MAPS.largest_shift * longest / fitted_to[0].dt
    free = scipy.optimize.least_squares(
        residual,
        [plain.x[0], 0.0],
        bounds=([lowest, -reach], [highest, reach]),
        x_scale=[0.1, 1.0],
        diff_step=[1e-4, 1e-4],
    )
    best, moved = (_solved(fitted_to, names, solution.x) for solution in (plain, free))
    slopes = np.asarray(free.jac)
    curvature = np.linalg.pinv(slopes.T @ slopes)
    scatter = 2.0 * free.cost / max(1, free.fun.size - 2)
    return LateralLeg(
        given=tuple(_remainder(r, names, start) for r in scored_on),
        fitted=tuple(_remainder(r, names, best) for r in scored_on),
        shifted=tuple(_remainder(r, names, moved) for r in scored_on),
        shift=moved.shift,
        shift_std=float(np.sqrt(scatter * curvature[1, 1])) * fitted_to[0].dt,
        noise_gain=_noise_gain(best, scored_on[0].dt),
    )


def _given(rig: Rig, values: Mapping[str, float]) -> _Numbers:
    """Return rate, gain and offset of the rig's own lateral equation."""
    lateral = rig.follower
    assert lateral is not None
    rates = lateral.gain * lateral.creepage
    numbers = {s: values[s.name] for s in rates.free_symbols if s.name in values}
    x, y = rig.motion.displacement, lateral.symbol
    rate = -float(derivative(rates, y).subs(numbers))
    gain = float(derivative(rates, x).subs(numbers)) / rate
    offset = float(rates.subs({**numbers, x: 0.0, y: 0.0})) / rate
    return _Numbers(rate, gain, offset)


def _solved(records: Sequence[Record], names: tuple[str, str], theta: NDArray[np.float64]) -> _Numbers:
    shift = float(theta[1]) * records[0].dt if theta.size > 1 else 0.0
    coefficients = _projected(records, names, float(np.exp(theta[0])), shift)[1]
    return _Numbers(float(np.exp(theta[0])), float(coefficients[0]), float(coefficients[1]), shift)


def _projected(
    records: Sequence[Record], names: tuple[str, str], rate: float, shift: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return residuals of all records and gain, offset and initial values that are best for a rate and a shift."""
    columns, targets = [], []
    for i, record in enumerate(records):
        rows = np.zeros((record.n_samples, 2 + len(records)))
        decay = _decay(record, rate)
        rows[:, 0] = _response(_moved(record, names[0], shift), record.dt, rate)
        rows[:, 1] = 1.0 - decay
        rows[:, 2 + i] = decay
        columns.append(rows)
        targets.append(record[names[1]])
    matrix, target = np.concatenate(columns), np.concatenate(targets)
    size = np.sqrt(np.sum(matrix**2, axis=0)) + 1e-300
    normal = (matrix / size).T @ (matrix / size)
    coefficients = np.linalg.lstsq(normal, (matrix / size).T @ target, rcond=1e-12)[0] / size
    return target - matrix @ coefficients, coefficients


def _remainder(record: Record, names: tuple[str, str], numbers: _Numbers) -> NDArray[np.float64]:
    """Return the residual of y with these parameters; only the initial value is fitted."""
    decay = _decay(record, numbers.rate)
    follows = numbers.gain * _response(_moved(record, names[0], numbers.shift), record.dt, numbers.rate)
    remainder = record[names[1]] - follows - numbers.offset * (1.0 - decay)
    return np.asarray(remainder - decay * (decay @ remainder) / (decay @ decay))


def _moved(record: Record, name: str, shift: float) -> NDArray[np.float64]:
    if shift == 0.0:
        return record[name]
    time = record.dt * np.arange(record.n_samples)
    at = np.clip(time + shift, 0.0, time[-1])
    return np.asarray(CubicSpline(time, record[name])(at))


def _decay(record: Record, rate: float) -> NDArray[np.float64]:
    return np.asarray(np.exp(-rate * record.dt * np.arange(record.n_samples)))


def _response(motion: NDArray[np.float64], dt: float, rate: float) -> NDArray[np.float64]:
    """Return the answer from rest of ``y' = rate (x - y)`` to samples joined by straight lines, shape (n_samples,)."""
    ahead, behind, kept = _coefficients(rate * dt)
    response = scipy.signal.lfilter([ahead, behind], [1.0, -kept], motion)
    first = ahead * motion[0] * kept ** np.arange(motion.size)
    return np.asarray(response - first)


def _coefficients(z: float) -> tuple[float, float, float]:
    kept = float(np.exp(-z))
    mean = -float(np.expm1(-z)) / z
    return 1.0 - mean, mean - kept, kept


def _noise_gain(numbers: _Numbers, dt: float) -> float:
    """Return the RMS answer of y to white noise of unit size in the measured motion."""
    ahead, behind, kept = _coefficients(numbers.rate * dt)
    first, then = ahead, behind + ahead * kept
    return abs(numbers.gain) * float(np.sqrt(first**2 + then**2 / (1.0 - kept**2)))
