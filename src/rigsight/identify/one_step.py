"""Change of a fit for slightly different records, by one Gauss-Newton step.

References
----------
A. C. Davison and D. V. Hinkley, *Bootstrap Methods and their Application* (Cambridge 1997), section 2.7 and chapter 7, for steps
from the estimate instead of new fits. R. Frisch and F. V. Waugh, Econometrica 1 (1933) 387, for projecting out the initial
states.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.covariance import propagated_covariance, sandwich_covariance
from rigsight.identify.fit.fit_result import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.information import central_sensitivities, place_of_fit
from rigsight.records.record import Floats

_FOLLOWED = 1e-9
"""Share of the strongest direction below which a combination of initial states has no influence."""


class OneStep:
    """Gauss-Newton steps from the end of a fit with standard errors; initial states and offsets are free as there."""

    def __init__(self, fit: GreyBoxFit, result: FitResult) -> None:
        problem, theta = place_of_fit(fit, result, result.values, result.free)
        n_free = len(result.free)
        self._records = fit.data.records
        self._chain = problem.coordinates.jacobian(theta[:n_free])
        self._error = problem.derivative_error
        self._rows, self._followed = [], []
        for _, derivative in central_sensitivities(problem, theta):
            if not np.all(np.isfinite(derivative)):
                raise SimulationError("The derivatives of the fit overflow.")
            basis = _basis(derivative[:, n_free:])
            own = derivative[:, :n_free]
            self._followed.append(basis)
            self._rows.append(own - basis @ (basis.T @ own))
        self._bread = np.sum([rows.T @ rows for rows in self._rows], axis=0).reshape(n_free, n_free)
        inverse = sandwich_covariance(self._bread, self._bread, self._error)
        self._inverse = np.where(np.isfinite(inverse), inverse, 0.0)

    def gradients(self, changes: Sequence[Floats]) -> Floats:
        """Return the projections of changes of the records on the derivatives of the fit, shape (n_free, n_replicates).

        A change of the readings of a record has the shape (n_samples, n_outputs, n_replicates).
        """
        return self._gradients(self._stacked(changes))

    def covariance(self, gradients: Floats) -> Floats:
        """Return the mean product of the steps that changes of the records would cause, from their `gradients`, as a covariance.

        In units of the parameters, infinite for one that the records do not determine. Steps are taken about the estimate and
        not about their mean: a mean other than zero is a bias of the estimate, which the standard error must include.
        """
        filling = gradients @ gradients.T / gradients.shape[1]
        found = sandwich_covariance(self._bread, filling, self._error)
        return propagated_covariance(found, self._chain)

    def remainder(self, changes: Sequence[Floats]) -> list[Floats]:
        """Return the changes that remain after the step, in units of the noise, shape as given; 0 for unmeasured outputs."""
        stacked = self._stacked(changes)
        steps = self._inverse @ self._gradients(stacked)
        found = []
        for change, column, rows, basis, record in zip(
            changes, stacked, self._rows, self._followed, self._records, strict=True
        ):
            rest = column - basis @ (basis.T @ column) - rows @ steps
            n_samples, n_outputs, n_replicates = change.shape
            whole = np.zeros((n_samples, n_outputs, n_replicates))
            used = np.flatnonzero(record.weights > 0.0)
            whole[:, used] = rest.reshape(used.size, n_samples, n_replicates).swapaxes(0, 1)
            found.append(whole)
        return found

    def _gradients(self, stacked: Sequence[Floats]) -> Floats:
        """Return J^T of changes, shape (n_free, n_replicates)."""
        return np.asarray(
            np.sum([rows.T @ column for rows, column in zip(self._rows, stacked, strict=True)], axis=0)
        )

    def _stacked(self, changes: Sequence[Floats]) -> list[Floats]:
        """Return weighted changes with the outputs of each record one after the other, shape (n, n_replicates)."""
        stacked = []
        for change, record in zip(changes, self._records, strict=True):
            used = np.flatnonzero(record.weights > 0.0)
            own = change[:, used].swapaxes(0, 1) * record.weights[used, None, None]
            stacked.append(own.reshape(-1, change.shape[2]))
        return stacked


def _basis(columns: Floats) -> Floats:
    """Return an orthonormal basis of the span of the columns, shape (n, rank)."""
    size = np.linalg.norm(columns, axis=0)
    remainder, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(remainder[:, singular > _FOLLOWED * np.max(singular, initial=0.0)])
