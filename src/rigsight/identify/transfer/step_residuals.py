"""Autocorrelation of the residuals of a fitted step, and the resulting covariance of the parameters.

An input disturbance causes oscillations at the resonance of the rig. In a short window a resonance is narrower than the distance
of spectral lines, so a smoothed spectrum cannot show it; but its shape is known from the fit. Residuals are modeled as a low-pass
disturbance filtered by the fitted transfer function plus white noise, with both sizes and the corner frequency from restricted
maximum likelihood.

References
----------
D. A. Harville, J. American Statistical Association 72 (1977) 320, for restricted maximum likelihood, which accounts for the part
of the residuals that the fitted parameters remove.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, expm, solve_continuous_lyapunov, toeplitz
from scipy.optimize import Bounds, minimize

from rigsight.identify.fit.covariance import colored_covariance, sandwich_covariance

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
