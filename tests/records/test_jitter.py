"""What jitter costs: the numbers of a drawn axis from stamps that wander, against their standard errors."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter, ss2tf

from rigsight.records.conditioning import time_base
from rigsight.records.record import Hold
from rigsight.records.resampling import joined

DT, N, FINE = 0.005, 2000, 20


def answer(rig: np.ndarray, u: np.ndarray, dt: float, hold: str) -> np.ndarray:
    """Position of an axis from rest, exact for its hold."""
    m, d, k = rig
    a, b, c = np.array([[0.0, 1.0], [-k / m, -d / m]]), np.array([[0.0], [1.0 / m]]), np.eye(2)[:1]
    *system, _ = cont2discrete((a, b, c, np.zeros((1, 1))), dt, hold)
    numerator, denominator = ss2tf(*system)
    return lfilter(numerator[0], denominator, u)


def held_answer(rig: np.ndarray, u: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Position at stamps between which the force is held, exact."""
    m, d, k = rig
    a = np.array([[0.0, 1.0], [-k / m, -d / m]])
    state, found = np.zeros(2), np.zeros(stamps.size)
    for i, step in enumerate(np.diff(stamps)):
        rest = np.array([u[i] / k, 0.0])
        state = rest + expm(a * step) @ (state - rest)
        found[i + 1] = state[0]
    return found


def fitted(
    rig: np.ndarray, u: np.ndarray, x: np.ndarray, dt: float, hold: str
) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of m, d, k of an output-error fit, and their standard errors."""
    scale = np.std(x)

    def residual(change: np.ndarray) -> np.ndarray:
        return (answer(rig * np.exp(change), u, dt, hold) - x) / scale

    fit = least_squares(residual, np.zeros(3), x_scale=1e-3)
    spread = np.sqrt(np.mean(fit.fun**2))
    return fit.x, spread * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))


@pytest.mark.parametrize("jitter", [0.005, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("hold", ["zoh", "band_limited"])
@pytest.mark.parametrize("seed", [0])
def test_jitter_leaves_the_numbers_within_their_errors(jitter: float, hold: Hold, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rig = np.array([2.0, 12.0, 800.0]) * np.exp(0.3 * rng.standard_normal(3))
    stamps = DT * (np.arange(N) + jitter * rng.uniform(0, 1, N))
    stamps[0] = 0.0
    waves, phases = np.linspace(0.1, 8.0, 30), rng.uniform(0, 2 * np.pi, 30)

    def force(t: np.ndarray) -> np.ndarray:
        return np.sum(np.sin(2 * np.pi * np.outer(t, waves) + phases) - np.sin(phases), axis=1)

    if hold == "zoh":
        u = force(DT * np.arange(N))
        clean = held_answer(rig, u, stamps)
    else:
        fine = DT / FINE * np.arange(FINE * (N + 2))
        u, clean = force(stamps), CubicSpline(fine, answer(rig, force(fine), DT / FINE, "foh"))(stamps)
    noise = 0.01 * np.std(clean) * rng.standard_normal(N)
    base = time_base(stamps, np.arange(N), "drawn")
    errors = {}
    for name, x in (("clean", clean), ("noisy", clean + noise)):
        found = joined("drawn", {"u": u, "x": x}, {"u": base, "x": base}, {}, None, {"u": hold})
        grid = found.t0 + found.dt * np.arange(found.samples["u"].size)
        if hold == "zoh":
            errors[name] = fitted(rig, found.samples["u"], found.samples["x"], found.dt, "zoh")
        else:
            # The wave itself is known: what is judged is the interpolation and not the hold of the fit.
            np.testing.assert_allclose(found.samples["u"], force(grid), atol=2e-3 * np.std(u))
            smooth = CubicSpline(fine, answer(rig, force(fine), DT / FINE, "foh"))(grid)
            errors[name] = (
                np.array([np.std(found.samples["x"] - smooth) / np.std(smooth)]),
                np.array([0.012]),
            )
    (added, _), (wrong, standard) = errors["clean"], errors["noisy"]
    assert np.all(np.abs(wrong) < 4.0 * standard)
    assert np.all(np.abs(added) < 0.2 * standard)
