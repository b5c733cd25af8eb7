"""Result of a fit of a PT1 or PT2."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.identify.transfer.transfer_form import TransferForm


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
    covariance: NDArray[np.float64]
    residuals: NDArray[np.float64] | NDArray[np.complex128]
    misfit: float
    success: bool
    message: str
    source: str
    response: str
    unit: str
    method: str
    records: tuple[str, ...] = ()
    free_motion: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    free_motion_covariance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def residual_rms(self) -> float:
        """RMS of the residuals, in the unit of the fitted quantity."""
        return float(np.sqrt(np.mean(np.abs(self.residuals) ** 2)))

    def covariance_of(self, *names: str) -> NDArray[np.float64]:
        """Return the covariance of some parameters in the order given, shape (n, n)."""
        rows = [self.names.index(name) for name in names]
        return self.covariance[np.ix_(rows, rows)]

    @property
    def theta(self) -> NDArray[np.float64]:
        """Parameters as a vector of the form, shape (n_parameters,)."""
        theta = self.form.vector(
            self.values["omega_b"], self.values.get("zeta", 1.0), self.values.get("dead_time", 0.0)
        )
        theta[0] = self.values["gain"]
        return theta

    def at(self, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return G(j omega) of the fit, dead time included, shape (n_frequencies,)."""
        return self.form.response(omega, self.theta)

    def standard_error_at(self, omega: NDArray[np.float64]) -> NDArray[np.float64]:
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
