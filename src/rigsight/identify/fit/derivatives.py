"""Derivatives of the residuals at the end of a fit, and Gauss-Newton steps from there: for one record, or for changed records.

References
----------
A. C. Davison and D. V. Hinkley, *Bootstrap Methods and their Application* (Cambridge 1997), section 2.7 and chapter 7, for steps
from the estimate instead of new fits. R. Frisch and F. V. Waugh, Econometrica 1 (1933) 387, for projecting out the initial
states.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.covariance import propagated_covariance, sandwich_covariance
from rigsight.identify.fit.fit_data import FitResult
from rigsight.identify.fit.fit_problem import Problem
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.records.record import Floats
from rigsight.simulate import carries_tangents

_LEAST_SLOPE = 1e-6
"""Share of the largest influence below which a direction has none, however exact its derivatives are."""
_MARGIN = 3.0
"""Factor of the error of the derivatives below which the influence of a direction counts as zero, as for covariances; no step is
taken along it."""
_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step; the largest that lowers the cost is taken, because the linearization may not hold for a whole step."""
_FOLLOWED = 1e-9
"""Share of the strongest direction below which a combination of initial states has no influence."""


@dataclass(frozen=True)
class RecordDerivatives:
    """Residuals of one record and their derivatives, in units of the noise."""

    residuals: Floats  # of all measured outputs one after the other, shape (n_measured * n_samples,)
    by_coordinate: Floats  # derivatives by the coordinates of the free parameters, shape (n, n_free)
    by_state: (
        Floats  # derivatives by the initial state of the record and then its offsets, shape (n, n_states)
    )
    n_measured: int  # number of outputs that the record contains


@dataclass(frozen=True)
class Derivatives:
    """The same for all records of a fit."""

    free: tuple[str, ...]  # names of the free parameters
    place: Floats  # their coordinates, shape (n_free,)
    records: tuple[RecordDerivatives, ...]
    coordinates: Coordinates  # map from coordinates to parameters
    error: float  # relative error of the derivatives


def derivatives(problem: GreyBoxFit, fit: FitResult, free: Sequence[str]) -> Derivatives:
    """Return residuals and derivatives by the free parameters of every record, at the values and initial states of a fit."""
    evaluated, theta = place_of_fit(problem, fit, fit.values, free)
    return Derivatives(
        free=tuple(free),
        place=theta[: len(free)],
        records=tuple(
            _of_record(evaluated, index, sensitivity)
            for index, sensitivity in enumerate(evaluated.sensitivities(theta))
        ),
        coordinates=evaluated.coordinates,
        error=evaluated.derivative_error,
    )


@dataclass(frozen=True)
class OwnDerivatives:
    """Estimate from one record alone, near the common values."""

    # Derivatives at the record's own values, with residuals extrapolated linearly from there to the common values.
    derivatives: RecordDerivatives
    fit: FitResult  # the record's own values and initial state


def own_derivatives(
    problem: GreyBoxFit, fit: FitResult, free: Sequence[str], most_steps: int, worth_a_step: float
) -> OwnDerivatives | None:
    """Return values and derivatives of one record some Gauss-Newton steps from the common values; None if there was no step.

    A step must be expected to lower the cost by the share `worth_a_step`, and is not taken if no share of it lowers the cost.
    """
    evaluated, start = place_of_fit(problem, fit, fit.values, free)
    n_free, coordinates, theta = len(free), evaluated.coordinates, start
    residual, slopes = evaluated.sensitivities(start)[0]
    for _ in range(most_steps):
        size = np.linalg.norm(slopes, axis=0)
        size[size == 0.0] = 1.0
        smallest = max(_LEAST_SLOPE, _MARGIN * evaluated.derivative_error)
        scaled = slopes / size
        inverse = np.linalg.pinv(scaled.T @ scaled, rcond=smallest**2, hermitian=True)
        step = -inverse @ (scaled.T @ residual) / size
        promised = float(residual @ residual) - float(np.sum((residual + slopes @ step) ** 2))
        if not promised > worth_a_step * float(residual @ residual):
            break
        for share in _SHARES:
            there = theta + share * step
            there[:n_free] = np.clip(there[:n_free], coordinates.lower, coordinates.upper)
            tried = evaluated.sensitivities(there)[0]
            # A motion that diverges, or whose derivatives do, is no improvement.
            with np.errstate(over="ignore", invalid="ignore"):
                is_finite = bool(np.isfinite(np.sum(tried[1] ** 2)))
                if is_finite and float(tried[0] @ tried[0]) < float(residual @ residual):
                    break
        else:
            break
        theta, (residual, slopes) = there, tried
    if theta is start:
        return None
    p = coordinates.to_parameters(theta[:n_free])
    own = replace(
        fit,
        values={**fit.values, **{name: float(p[coordinates.index[i]]) for i, name in enumerate(free)}},
        initial_states=tuple(evaluated.states(theta)),
    )
    return OwnDerivatives(_of_record(evaluated, 0, (residual - slopes @ (theta - start), slopes)), own)


def _of_record(evaluated: Problem, index: int, sensitivity: tuple[Floats, Floats]) -> RecordDerivatives:
    (residual, slopes), n_free = sensitivity, evaluated.n_free
    measured = int(np.count_nonzero(evaluated.data.records[index].weights))
    return RecordDerivatives(residual, slopes[:, :n_free], slopes[:, n_free:], measured)


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
            basis = orthonormal_basis(derivative[:, n_free:], _FOLLOWED)
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


def orthonormal_basis(columns: Floats, least: float) -> Floats:
    """Return an orthonormal basis of the columns' span, shape (n, rank), without what is below a share of the strongest."""
    size = np.linalg.norm(columns, axis=0)
    base, singular, _ = np.linalg.svd(columns[:, size > 0.0] / size[size > 0.0], full_matrices=False)
    return np.asarray(base[:, singular > least * np.max(singular, initial=0.0)])


def place_of_fit(
    fit: GreyBoxFit, result: FitResult, values: Mapping[str, float], free: Sequence[str]
) -> tuple[Problem, Floats]:
    """Return the problem and the coordinates of parameter values, with the initial states and steps of a result."""
    coordinates = Coordinates.of(fit.data.structure, free, values, fit.scales)
    own = coordinates.from_values(values)
    sizes = fit.data.state_sizes(coordinates.to_parameters(own)[:, None])[:, 0]
    # The range of a limited state may be zero.
    units = np.where(sizes > 0.0, sizes, 1.0)
    theta = np.concatenate([own, *(state / units for state in result.initial_states)])
    problem = Problem(fit.data, coordinates, sizes.size, np.full(theta.size, np.inf))
    problem.substeps = list(result.substeps)
    return problem, theta


def central_sensitivities(problem: Problem, theta: Floats) -> list[tuple[Floats, Floats]]:
    """Return residuals and derivatives per record; if the derivatives are differences, central ones."""
    # The error of one-sided differences is their step times the curvature, which looks like information where there is none.
    forward = problem.sensitivities(theta)
    if carries_tangents(problem.data.structure):
        return forward
    problem.upper = np.full(theta.size, -np.inf)
    backward = problem.sensitivities(theta)
    return [
        (residual, 0.5 * (one + other)) for (residual, one), (_, other) in zip(forward, backward, strict=True)
    ]
