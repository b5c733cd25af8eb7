"""Response of a PT1 or a PT2 with dead time over time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from rigsight.identify import TransferForm
from rigsight.records.record import Hold


def over_time(
    form: TransferForm, u: NDArray[np.float64], dt: float, hold: Hold, theta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the response from rest to an input that is zero up to its first sample, shape (n_samples,).

    Exact for ``"zoh"`` and ``"foh"``, also for a dead time between two samples; ``"band_limited"`` is treated as ``"foh"``.

    Parameters
    ----------
    form
        PT1 or PT2.
    u
        Samples of the input, the first one zero, shape (n_samples,).
    dt
        Sample time [s].
    hold
        Hold of the input between samples.
    theta
        Parameters, shape (n_parameters,).
    """
    parameters = dict(zip(form.names, form.natural(theta)[0], strict=True))
    gain, omega_b = parameters["gain"], parameters["omega_b"]
    zeta, dead_time = parameters.get("zeta", 0.0), parameters.get("dead_time", 0.0)
    if form.order == "pt1":
        a, b = np.array([[-omega_b]]), np.array([omega_b])
    else:
        a = np.array([[0.0, 1.0], [-(omega_b**2), -2.0 * zeta * omega_b]])
        b = np.array([0.0, omega_b**2])
    phi, constant, ramp = _transition(a, b, dt)
    later = np.zeros_like(ramp) if hold == "zoh" else ramp / dt
    states = _states(phi, constant - later, later, u)
    # The response at t - T is between two samples: one exact step from the sample before it.
    whole = int(np.floor(dead_time / dt))
    phi, constant, ramp = _transition(a, b, dt - (dead_time - whole * dt))
    rise = np.zeros_like(u) if hold == "zoh" else np.append(np.diff(u), 0.0) / dt
    ahead = states @ phi[0] + constant[0] * u + ramp[0] * rise
    answer = np.zeros_like(u)
    answer[whole + 1 :] = ahead[: max(u.size - whole - 1, 0)]
    return np.asarray(gain * answer)


def _transition(
    a: NDArray[np.float64], b: NDArray[np.float64], time: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the effects after `time` of the state, of a constant input and of a ramp with slope one."""
    n = b.size
    augmented = np.zeros((n + 2, n + 2))
    augmented[:n, :n] = a
    augmented[:n, n] = b
    augmented[n, n + 1] = 1.0
    moved = expm(augmented * time)
    return moved[:n, :n], moved[:n, n], moved[:n, n + 1]


def _states(
    phi: NDArray[np.float64], now: NDArray[np.float64], later: NDArray[np.float64], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Solve ``x[i+1] = phi x[i] + now u[i] + later u[i+1]`` from rest, shape (n_samples, n_states)."""
    if now.size == 1:
        return np.asarray(lfilter([later[0], now[0]], [1.0, -phi[0, 0]], u))[:, None]
    trace = float(np.trace(phi))
    adjugate = phi - trace * np.eye(2)
    numerators = np.array([later, now + adjugate @ later, adjugate @ now])
    denominator = [1.0, -trace, float(np.linalg.det(phi))]
    return np.column_stack([lfilter(numerators[:, i], denominator, u) for i in range(2)])
