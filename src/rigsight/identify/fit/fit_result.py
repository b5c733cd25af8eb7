"""What a grey-box fit found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.simulate import Structure, Substeps


@dataclass(frozen=True)
class FitResult:
    """Result of an output-error fit.

    Attributes
    ----------
    structure
        Rig and effects that were fitted.
    success, message
        Whether the optimizer converged, and its words.
    values
        Every parameter of the structure by name, fitted or not.
    standard_errors
        Of the fitted parameters by name, allowing for colored residuals; infinite where the records do not determine one.
    initial_states
        Per record, shape (n_states,).
    cost
        Sum of squared weighted residuals.
    n_samples
        Residuals in that sum.
    n_evaluations
        Evaluations of residuals and derivatives.
    free
        Names of the fitted parameters, in the order of `covariance`.
    covariance
        Shape (n_free, n_free), in units of the parameters.
    substeps
        Integration steps per piece of the input that were used for each record.
    """

    structure: Structure
    success: bool
    message: str
    values: dict[str, float]
    standard_errors: dict[str, float]
    initial_states: tuple[NDArray[np.float64], ...]
    cost: float
    n_samples: int
    n_evaluations: int
    free: tuple[str, ...]
    covariance: NDArray[np.float64]
    residuals: tuple[NDArray[np.float64], ...]
    """Measured minus simulated per record, shape (n_samples, n_outputs), NaN where an output was not measured."""
    substeps: tuple[Substeps, ...] = ()

    @property
    def weighted_rms(self) -> float:
        """RMS of the weighted residuals."""
        return float(np.sqrt(self.cost / self.n_samples))
