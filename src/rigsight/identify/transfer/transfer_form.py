"""Response of a PT1 or a PT2 with dead time: over frequency, with derivatives, and its fit.

``G(s) = k e^(-s T) / (1 + s / omega_b)`` (PT1, thesis equation 2.7) and
``G(s) = k e^(-s T) omega_b^2 / (s^2 + 2 zeta omega_b s + omega_b^2)`` (PT2, thesis equation 2.9).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from rigsight.errors import InputError
from rigsight.records.record import Floats, Hold

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

    def vector(self, omega_b: float, zeta: float, dead_time: float) -> Floats:
        """Return the parameters for a gain of one, shape (n_parameters,)."""
        damping = [np.log(zeta)] if self.order == "pt2" else []
        return np.array([1.0, np.log(omega_b), *damping, *([dead_time] if self.with_dead_time else [])])

    def natural(self, theta: Floats) -> tuple[Floats, Floats]:
        """Return the parameters without logarithms and d natural / d theta (a diagonal), shape (n_parameters,) each."""
        values, chain = theta.copy(), np.ones_like(theta)
        shape = slice(1, 1 + self.n_poles)
        values[shape] = np.exp(theta[shape])
        chain[shape] = values[shape]
        return values, chain

    def _split(self, theta: Floats) -> tuple[float, float, float, float]:
        zeta = float(np.exp(theta[2])) if self.order == "pt2" else 0.0
        dead_time = float(theta[-1]) if self.with_dead_time else 0.0
        return float(theta[0]), float(np.exp(theta[1])), zeta, dead_time

    def poles(self, theta: Floats) -> NDArray[np.complex128]:
        """Return the poles [1/s], shape (order,)."""
        _, omega_b, zeta, _ = self._split(theta)
        if self.order == "pt1":
            return np.array([-omega_b], dtype=np.complex128)
        return np.asarray(omega_b * (-zeta + np.array([1.0, -1.0]) * np.sqrt(complex(zeta**2 - 1.0))))

    def response(self, omega: Floats, theta: Floats) -> NDArray[np.complex128]:
        """Return G(j omega), shape (n_frequencies,)."""
        gain, omega_b, zeta, dead_time = self._split(theta)
        ratio = omega / omega_b
        delay = np.exp(-1j * omega * dead_time)
        if self.order == "pt1":
            return np.asarray(gain * delay / (1.0 + 1j * ratio))
        return np.asarray(gain * delay / (1.0 - ratio**2 + 2j * zeta * ratio))

    def derivatives(self, omega: Floats, theta: Floats) -> NDArray[np.complex128]:
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

    def sampled_response(self, omega: Floats, dt: float, hold: Hold, theta: Floats) -> NDArray[np.complex128]:
        """Return the ratio of samples to those of a held input, shape (n_frequencies,).

        Exact for ``"zoh"`` and ``"foh"`` but for free motions, also for a dead time between two samples.
        """
        gain, omega_b, zeta, dead_time = self._split(theta)
        if self.order == "pt1":
            a, b = np.array([[-omega_b]]), np.array([omega_b])
        else:
            a = np.array([[0.0, 1.0], [-(omega_b**2), -2.0 * zeta * omega_b]])
            b = np.array([0.0, omega_b**2])
        phi, constant, ramp = _transition(a, b, dt)
        z = np.exp(1j * omega * dt)[:, None]
        # Slope of the input after a sample over this sample.
        rise = np.zeros_like(z) if hold == "zoh" else (z - 1.0) / dt
        shifted = z[:, :, None] * np.eye(b.size) - phi
        states = np.linalg.solve(shifted, (constant + ramp * rise)[:, :, None])[:, :, 0]
        # The response at t - T is between two samples: one exact step from the sample before it.
        whole = int(np.floor(dead_time / dt))
        phi, constant, ramp = _transition(a, b, dt - (dead_time - whole * dt))
        ahead = states @ phi[0] + constant[0] + ramp[0] * rise[:, 0]
        return np.asarray(gain * ahead * z[:, 0] ** -(whole + 1))


@dataclass(frozen=True, eq=False)
class TransferFit:
    """A PT1 or PT2 with its uncertainty.

    Attributes
    ----------
    form
        Order, and whether a dead time was fitted.
    names
        ``gain`` [unit], ``omega_b`` [rad/s], ``zeta`` (PT2), ``dead_time`` [s] (if fitted), ``offset`` (from steps: the response
        at rest, in its unit).
    values, standard_errors
        By name; an error is infinite if the data do not determine the parameter.
    covariance
        In the order of `names`, shape (n_parameters, n_parameters).
    residuals
        Measured minus fitted, not weighted: complex or magnitudes per line, or samples, shape (n_data,).
    misfit
        RMS of the residuals in units of their expected size; about 1 if noise explains them, NaN if there are no variances.
    success, message
        Whether the fit can be used, and notes on it.
    source, response, unit
        The signals, and the unit of the gain.
    method
        Name of the method.
    records
        Names of the fitted records.
    free_motion, free_motion_covariance
        Weights of the free motions fitted to a `PlainRatio`, shape (n_motions,), and their covariance; empty for other data.
    """

    form: TransferForm
    names: tuple[str, ...]
    values: dict[str, float]
    standard_errors: dict[str, float]
    covariance: Floats
    residuals: Floats | NDArray[np.complex128]
    misfit: float
    success: bool
    message: str
    source: str
    response: str
    unit: str
    method: str
    records: tuple[str, ...] = ()
    free_motion: Floats = field(default_factory=lambda: np.zeros(0))
    free_motion_covariance: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def covariance_of(self, *names: str) -> Floats:
        """Return the covariance of some parameters in the order given, shape (n, n)."""
        rows = [self.names.index(name) for name in names]
        return self.covariance[np.ix_(rows, rows)]

    @property
    def theta(self) -> Floats:
        """Parameters as a vector of the form, shape (n_parameters,)."""
        theta = self.form.vector(
            self.values["omega_b"], self.values.get("zeta", 1.0), self.values.get("dead_time", 0.0)
        )
        theta[0] = self.values["gain"]
        return theta

    def at(self, omega: Floats) -> NDArray[np.complex128]:
        """Return G(j omega) of the fit, dead time included, shape (n_frequencies,)."""
        return self.form.response(omega, self.theta)

    def standard_error_at(self, omega: Floats) -> Floats:
        """Return the standard error ``sqrt(E |G - truth|^2)`` of G(j omega) by the delta method, shape (n_frequencies,)."""
        theta = self.theta
        _, chain = self.form.natural(theta)
        slopes = self.form.derivatives(omega, theta) / chain
        own = self.covariance_of(*self.form.names)
        return np.asarray(np.sqrt(np.maximum(np.einsum("ki,ij,kj->k", slopes.conj(), own, slopes).real, 0.0)))

    def to_control(self, pade_order: int | None = None) -> Any:
        """Return the fit as a ``control.TransferFunction``.

        Parameters
        ----------
        pade_order
            Order of the Pade approximation of the dead time. None returns the rational part alone, because a rational transfer
            function cannot represent a dead time exactly.

        Raises
        ------
        InputError
            If the order is below 1, or if it is given although no dead time was fitted.
        """
        import control

        gain, omega_b = self.values["gain"], self.values["omega_b"]
        if self.form.order == "pt1":
            rational = control.tf([gain * omega_b], [1.0, omega_b])
        else:
            rational = control.tf([gain * omega_b**2], [1.0, 2.0 * self.values["zeta"] * omega_b, omega_b**2])
        if pade_order is None:
            return rational
        if pade_order < 1 or not self.form.with_dead_time:
            raise InputError(
                f"A Pade approximation of order {pade_order} needs an order of at least 1 and a fit with dead time. Omit "
                f"pade_order to get the rational part."
            )
        return rational * control.tf(*control.pade(self.values["dead_time"], pade_order))


def _transition(a: Floats, b: Floats, time: float) -> tuple[Floats, Floats, Floats]:
    """Return the effects after `time` of the state, of a constant input and of a ramp with slope one."""
    n = b.size
    augmented = np.zeros((n + 2, n + 2))
    augmented[:n, :n] = a
    augmented[:n, n] = b
    augmented[n, n + 1] = 1.0
    moved = expm(augmented * time)
    return moved[:n, :n], moved[:n, n], moved[:n, n + 1]
