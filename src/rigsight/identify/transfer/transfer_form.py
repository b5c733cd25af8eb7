"""Response of a PT1 or a PT2 with dead time: over frequency with derivatives, and over time.

``G(s) = k e^(-s T) / (1 + s / omega_b)`` (PT1, thesis equation 2.7) and
``G(s) = k e^(-s T) omega_b^2 / (s^2 + 2 zeta omega_b s + omega_b^2)`` (PT2, thesis equation 2.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from rigsight.records.record import Hold

Order = Literal["pt1", "pt2"]


@dataclass(frozen=True)
class TransferForm:
    """Form of a transfer function: its order, and whether it has a dead time.

    A vector of parameters contains gain, ln omega_b, ln zeta (PT2 only) and dead time [s] (if there is one).
    """

    order: Order
    with_dead_time: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in order."""
        damping = ("zeta",) if self.order == "pt2" else ()
        return ("gain", "omega_b", *damping, *(("dead_time",) if self.with_dead_time else ()))

    @property
    def n_poles(self) -> int:
        """Number of poles, and of the logarithms that set them."""
        return 2 if self.order == "pt2" else 1

    def vector(self, omega_b: float, zeta: float, dead_time: float) -> NDArray[np.float64]:
        """Return the parameters for a gain of one, shape (n_parameters,)."""
        damping = [np.log(zeta)] if self.order == "pt2" else []
        return np.array([1.0, np.log(omega_b), *damping, *([dead_time] if self.with_dead_time else [])])

    def natural(self, theta: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the parameters without logarithms and d natural / d theta (a diagonal), shape (n_parameters,) each."""
        values, chain = theta.copy(), np.ones_like(theta)
        shape = slice(1, 1 + self.n_poles)
        values[shape] = np.exp(theta[shape])
        chain[shape] = values[shape]
        return values, chain

    def _split(self, theta: NDArray[np.float64]) -> tuple[float, float, float, float]:
        zeta = float(np.exp(theta[2])) if self.order == "pt2" else 0.0
        return (
            float(theta[0]),
            float(np.exp(theta[1])),
            zeta,
            float(theta[-1]) if self.with_dead_time else 0.0,
        )

    def poles(self, theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the poles [1/s], shape (order,)."""
        _, omega_b, zeta, _ = self._split(theta)
        if self.order == "pt1":
            return np.array([-omega_b], dtype=np.complex128)
        return np.asarray(omega_b * (-zeta + np.array([1.0, -1.0]) * np.sqrt(complex(zeta**2 - 1.0))))

    def response(self, omega: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return G(j omega), shape (n_frequencies,)."""
        gain, omega_b, zeta, dead_time = self._split(theta)
        ratio = omega / omega_b
        delay = np.exp(-1j * omega * dead_time)
        if self.order == "pt1":
            return np.asarray(gain * delay / (1.0 + 1j * ratio))
        return np.asarray(gain * delay / (1.0 - ratio**2 + 2j * zeta * ratio))

    def derivatives(self, omega: NDArray[np.float64], theta: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return d G(j omega) / d theta, shape (n_frequencies, n_parameters)."""
        _, omega_b, zeta, dead_time = self._split(theta)
        ratio = omega / omega_b
        value = self.response(omega, theta)
        columns = [np.exp(-1j * omega * dead_time)]
        if self.order == "pt1":
            denominator = 1.0 + 1j * ratio
            columns = [columns[0] / denominator, value / denominator * 1j * ratio]
        else:
            denominator = 1.0 - ratio**2 + 2j * zeta * ratio
            columns = [
                columns[0] / denominator,
                -value / denominator * (2.0 * ratio**2 - 2j * zeta * ratio),
                -value / denominator * 2j * zeta * ratio,
            ]
        if self.with_dead_time:
            columns.append(-1j * omega * value)
        return np.column_stack(columns)

    def sampled_response(
        self, n_samples: int, dt: float, hold: Hold, theta: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        """Return the response of samples to those of a held input at each line of a record, shape (n_samples // 2 + 1,).

        Exact like `over_time`. What a slow form still does after the end of the record is a free motion.
        """
        pulse = np.zeros(n_samples)
        pulse[1] = 1.0
        turn = np.exp(2j * np.pi * np.fft.rfftfreq(n_samples))
        return np.asarray(np.fft.rfft(self.over_time(pulse, dt, hold, theta)) * turn)

    def over_time(
        self, u: NDArray[np.float64], dt: float, hold: Hold, theta: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the response from rest to an input that is zero up to its first sample, shape (n_samples,).

        Exact for ``"zoh"`` and ``"foh"``, also for a dead time between two samples; ``"band_limited"`` is treated as ``"foh"``.

        Parameters
        ----------
        u
            Samples of the input, the first one zero, shape (n_samples,).
        dt
            Sample time [s].
        hold
            Hold of the input between samples.
        theta
            Parameters, shape (n_parameters,).
        """
        gain, omega_b, zeta, dead_time = self._split(theta)
        if self.order == "pt1":
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
