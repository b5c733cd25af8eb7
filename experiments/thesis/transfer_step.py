"""PT1 or PT2 from a recorded step: output-error fit over a time window, from rest.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), chapters 7 and 9, for output error and its covariance with colored
residuals. The window is the thesis's (section 5.2.2: 0.6 A at 180 s, compared from 180 to 184 s, offset removed).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from form_over_time import over_time
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, expm, solve_continuous_lyapunov, toeplitz
from scipy.optimize import Bounds, least_squares, minimize

from rigsight.errors import InputError, check_option
from rigsight.frequency.signal_pair import pair_unit
from rigsight.identify.fit.covariance import colored_covariance, propagated_covariance, sandwich_covariance
from rigsight.identify.information import POORLY_KNOWN
from rigsight.identify.transfer.transfer_form import Order, TransferFit, TransferForm
from rigsight.records.record import Hold, Record
from rigsight.records.signals import is_constant

_PHASE_PER_BLOCK = 0.5
"""Phase of the fitted form's break frequency per block of averaged samples [rad]."""
_MOST_BLOCKS = 600
_LEAST_BLOCKS = 40
_LOG_RATIOS = (-6.0, 0.0, 2.0, 4.0, 6.0, 9.0)
"""Logarithms of the disturbance's variance over that of the white noise at the starts of the search."""
_CORNERS = (0.2, 1.0, 5.0)
"""Corner frequencies of the disturbance at the starts of the search, over the break frequency."""
_CORNER_RANGE = (0.02, 50.0)
_LOG_RATIO_RANGE = (-12.0, 25.0)


_GRID_FREQUENCIES = 17
_GRID_DAMPINGS = np.geomspace(0.03, 5.0, 6)
_GRID_DEAD_TIMES = 6
_STARTS = 2
_DAMPING_RANGE = (1e-4, 1e3)
_LEAST_AFTER = 20
_STEP_OVER_NOISE = 10.0
_DIFFERENCE = 1e-5


def fit_step(
    record: Record,
    source: str,
    response: str,
    order: Order,
    start: float | None = None,
    stop: float | None = None,
    longest_dead_time: float = 0.0,
) -> TransferFit:
    """Fit a PT1 or PT2 and an offset to the recorded response to a step.

    Parameters
    ----------
    record
        Measured record. The input need not be an ideal step: its samples are simulated with the record's hold.
    source, response
        Names of the input and of the output.
    order
        ``"pt1"`` (thesis, 2.7) or ``"pt2"`` (2.9).
    start, stop
        Window [s] in the record's time, default the whole record. The rig must be at rest at its start, which may be the time of
        the step.
    longest_dead_time
        Longest dead time that is searched [s]; 0 fits none.

    Returns
    -------
    The fit, with ``offset`` (the response at rest) among its parameters; standard errors allow for colored residuals. ``success``
    is False, with the reason as ``message``, if a parameter is not determined or the optimizer did not converge.

    Raises
    ------
    InputError
        If the window contains no step or too few samples after it, or the order or the dead time is not allowed.
    """
    check_option("order", order, ("pt1", "pt2"))
    if not (np.isfinite(longest_dead_time) and longest_dead_time >= 0.0):
        raise InputError(f"The longest dead time must be at least 0 s and finite, got {longest_dead_time!r}.")
    form = TransferForm(order, longest_dead_time > 0.0)
    problem = _problem(record, source, response, form, start, stop, longest_dead_time)
    lower, upper = problem.bounds()
    best = None
    for guess in problem.starts():
        inside = np.clip(guess, lower, upper)
        found = least_squares(problem.residual, inside, bounds=(lower, upper), x_scale="jac", ftol=1e-12)
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    natural, chain = form.natural(best.x[:-1])
    values, chain = np.append(natural, best.x[-1]), np.append(chain, 1.0)
    residual = problem.residual(best.x)
    shaped = dict(zip(form.names, natural, strict=True))
    slopes = problem.slopes(best.x, upper)
    covariance = step_covariance(residual, slopes, problem.dt, shaped["omega_b"], shaped.get("zeta"))
    covariance = propagated_covariance(covariance, np.diag(chain))
    names = (*form.names, "offset")
    errors = np.sqrt(np.diag(covariance))
    poor = [
        name
        for name, value, error in zip(names[:2], values, errors, strict=False)
        if not error < POORLY_KNOWN * abs(value)
    ]
    notes = [] if best.status > 0 else [str(best.message)]
    if poor:
        notes.append(
            f"The step does not determine {' and '.join(poor)}: the response of '{response}' does not exceed the noise, or the "
            f"window ends before it settles."
        )
    return TransferFit(
        form=form,
        names=names,
        values=dict(zip(names, map(float, values), strict=True)),
        standard_errors=dict(zip(names, map(float, errors), strict=True)),
        covariance=covariance,
        residuals=residual,
        misfit=float("nan"),
        success=not notes,
        message=" ".join(notes) or "Converged.",
        source=source,
        response=response,
        unit=pair_unit(record, source, response),
        method=f"output fit of a step, {problem.begin:g} to {problem.end:g} s",
        records=(record.name,),
    )


@dataclass(frozen=True, eq=False)
class _Problem:
    """Residuals as a function of the parameters of a form, and of the offset as the last one."""

    form: TransferForm
    u: NDArray[np.float64]
    """Input minus its value at rest, from one sample before the window to its end, shape (1 + n_samples,)."""
    measured: NDArray[np.float64]
    dt: float
    hold: Hold
    longest_dead_time: float
    begin: float
    end: float

    def residual(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return measured minus fitted, shape (n_samples,)."""
        fitted = over_time(self.form, self.u, self.dt, self.hold, theta[:-1])[1:]
        return np.asarray(self.measured - theta[-1] - fitted)

    def slopes(self, theta: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residuals, shape (n_samples, n_parameters)."""
        columns = []
        for i in range(theta.size):
            step = np.zeros_like(theta)
            scale = max(abs(theta[i]), 1e-6) if i in (0, theta.size - 1) else 1.0
            if self.form.with_dead_time and i == theta.size - 2:
                scale = 1e2 * self.dt
            step[i] = _DIFFERENCE * scale * (-1.0 if theta[i] + _DIFFERENCE * scale > upper[i] else 1.0)
            columns.append((self.residual(theta + step) - self.residual(theta)) / step[i])
        return np.column_stack(columns)

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and upper bounds of the parameters, shape (n_parameters,) each."""
        low, high = self._reach()
        longest = max(self.longest_dead_time, 1e-12)
        lower = np.append(self.form.vector(low, _DAMPING_RANGE[0], 0.0), -np.inf)
        upper = np.append(self.form.vector(high, _DAMPING_RANGE[1], longest), np.inf)
        lower[0], upper[0] = -np.inf, np.inf
        return lower, upper

    def _reach(self) -> tuple[float, float]:
        return 0.3 / (self.dt * self.measured.size), 0.8 * np.pi / self.dt

    def starts(self) -> list[NDArray[np.float64]]:
        """Return the best points of the grid, each with its best gain and offset."""
        low, high = self._reach()
        dampings = _GRID_DAMPINGS if self.form.order == "pt2" else np.ones(1)
        delays = (
            np.linspace(0.0, self.longest_dead_time, _GRID_DEAD_TIMES)
            if self.form.with_dead_time
            else np.zeros(1)
        )
        found = []
        for omega_b, zeta, delay in itertools.product(
            np.geomspace(low, high, _GRID_FREQUENCIES), dampings, delays
        ):
            theta = self.form.vector(float(omega_b), float(zeta), float(delay))
            shape = over_time(self.form, self.u, self.dt, self.hold, theta)[1:]
            centered = shape - np.mean(shape)
            theta[0] = centered @ self.measured / max(float(centered @ centered), 1e-300)
            offset = float(np.mean(self.measured - theta[0] * shape))
            error = float(np.sum((self.measured - theta[0] * shape - offset) ** 2))
            found.append((error, np.append(theta, offset)))
        found.sort(key=lambda pair: pair[0])
        return [theta for _, theta in found[:_STARTS]]


def input_at_rest(record: Record, source: str) -> float:
    """Return the input before a record of a step: its first sample, or 0 if the record begins with the step."""
    return 0.0 if is_constant(record[source]) else float(record[source][0])


def _problem(
    record: Record,
    source: str,
    response: str,
    form: TransferForm,
    start: float | None,
    stop: float | None,
    longest_dead_time: float,
) -> _Problem:
    t, dt = record.t, record.dt
    begin = t[0] if start is None else start
    end = t[-1] if stop is None else stop
    inside = np.flatnonzero((t >= begin - 0.5 * dt) & (t <= end + 0.5 * dt))
    what = f"Record '{record.name}', {begin:g} to {end:g} s"
    if inside.size < _LEAST_AFTER:
        raise InputError(
            f"{what}: the window holds {inside.size} samples, at least {_LEAST_AFTER} are needed. The record covers "
            f"{t[0]:g} to {t[-1]:g} s."
        )
    first, last = int(inside[0]), int(inside[-1]) + 1
    before = max(first - 1, 0)
    u = record[source][before:last]
    if first == before:
        u = np.concatenate([[input_at_rest(record, source)], u])
    scatter = float(np.median(np.abs(np.diff(u))))
    if np.ptp(u) <= max(_STEP_OVER_NOISE * scatter, 1e-12 * float(np.max(np.abs(u)))):
        raise InputError(
            f"{what}: '{source}' has no step, it stays between {np.min(u):.4g} and {np.max(u):.4g}. Choose a window that "
            "begins before the step or with it."
        )
    jump = int(np.argmax(np.abs(u - u[0]) > 0.5 * np.max(np.abs(u - u[0]))))
    if u.size - jump < _LEAST_AFTER:
        raise InputError(
            f"{what}: '{source}' steps {u.size - jump} samples before the end; at least {_LEAST_AFTER} samples of the response "
            f"are needed. End the window later."
        )
    return _Problem(
        form,
        u - u[0],
        np.asarray(record[response][first:last]),
        dt,
        record.hold,
        longest_dead_time,
        float(begin),
        float(end),
    )


def step_covariance(
    residual: NDArray[np.float64],
    slopes: NDArray[np.float64],
    dt: float,
    omega_b: float,
    zeta: float | None,
) -> NDArray[np.float64]:
    """Return the covariance of least-squares parameters of a step."""
    per_block = max(math.floor(_PHASE_PER_BLOCK / (omega_b * dt)), 1)
    per_block = max(min(per_block, residual.size // _LEAST_BLOCKS), 1)
    count = residual.size // per_block
    if count > _MOST_BLOCKS:
        return colored_covariance([(residual, slopes)], slopes.shape[1])
    used = slice(0, count * per_block)
    own = residual[used].reshape(count, per_block).mean(axis=1)
    columns = slopes[used].reshape(count, per_block, -1).mean(axis=1)
    noise = _noise(own, columns, dt * per_block, omega_b, zeta)
    return sandwich_covariance(columns.T @ columns, columns.T @ noise @ columns)


def _noise(
    residual: NDArray[np.float64],
    columns: NDArray[np.float64],
    dt: float,
    omega_b: float,
    zeta: float | None,
) -> NDArray[np.float64]:
    """Return the most likely covariance matrix of the noise, shape (n_blocks, n_blocks)."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    basis, strengths, _ = np.linalg.svd(columns / np.where(size == 0.0, 1.0, size), full_matrices=False)
    basis = basis[:, strengths > 1e-9 * max(float(strengths[0]), 1e-300)]
    degrees = residual.size - basis.shape[1]
    scale = max(float(np.sqrt(np.mean(residual**2))), 1e-300)
    scaled = residual / scale

    def shape(ratio: float, corner: float) -> NDArray[np.float64]:
        lags = _autocovariance(residual.size, dt, omega_b, zeta, corner * omega_b)
        matrix = math.exp(ratio) * lags
        matrix[0] += 1.0
        return np.asarray(toeplitz(matrix))

    def cost(x: NDArray[np.float64]) -> tuple[float, float]:
        """Return the negative logarithm of the restricted likelihood at the best variance, and this variance."""
        matrix = shape(x[0], math.exp(x[1]))
        factor = cho_factor(matrix, lower=True)
        weighted = cho_solve(factor, np.column_stack([basis, scaled]))
        information = basis.T @ weighted[:, :-1]
        score = basis.T @ weighted[:, -1]
        square = float(scaled @ weighted[:, -1] - score @ np.linalg.solve(information, score))
        variance = max(square / degrees, 1e-300)
        spread = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
        return 0.5 * (
            degrees * math.log(variance) + spread + float(np.linalg.slogdet(information)[1])
        ), variance

    bounds = Bounds(*np.transpose([_LOG_RATIO_RANGE, np.log(_CORNER_RANGE)]))
    starts = [np.array([ratio, math.log(corner)]) for ratio in _LOG_RATIOS for corner in _CORNERS]
    best: Any = min(starts, key=lambda x: cost(x)[0])
    around = best + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 0.7]])
    options: Any = {"xatol": 0.05, "fatol": 0.01, "initial_simplex": around}
    found = minimize(  # type: ignore[call-overload]
        lambda x: cost(x)[0], best, method="Nelder-Mead", bounds=bounds, options=options
    )
    variance = cost(found.x)[1] * scale**2
    return np.asarray(variance * shape(found.x[0], math.exp(found.x[1])))


def _autocovariance(
    count: int, dt: float, omega_b: float, zeta: float | None, corner: float
) -> NDArray[np.float64]:
    """Return the autocovariance at multiples of `dt` of low-pass noise filtered by a PT1 or PT2, with unit variance."""
    if zeta is None:
        a = np.array([[-omega_b, omega_b], [0.0, -corner]])
    else:
        a = np.array(
            [[0.0, 1.0, 0.0], [-(omega_b**2), -2.0 * zeta * omega_b, omega_b**2], [0.0, 0.0, -corner]]
        )
    driven = np.zeros_like(a)
    driven[-1, -1] = -2.0 * corner
    state = solve_continuous_lyapunov(a, driven)[:, 0]
    step = expm(a * dt)
    lags = np.empty(count)
    for i in range(count):
        lags[i] = state[0]
        state = step @ state
    return np.asarray(lags / lags[0])
