"""Derivatives of the residuals of each record by the fitted parameters and its initial state, at the end of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.fit_problem import Problem
from rigsight.identify.fit.fit_result import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.records.record import Floats

_LEAST_SLOPE = 1e-6
"""Share of the largest influence below which a direction has none, however exact its derivatives are."""
_MARGIN = 3.0
"""Factor of the error of the derivatives below which the influence of a direction counts as zero, as for covariances; no step is
taken along it."""
_SHARES = (1.0, 0.3, 0.1, 0.03)
"""Shares of a step; the largest that lowers the cost is taken, because the linearization may not hold for a whole step."""


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
    evaluated, theta = _at_end(problem, fit, free)
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

    # Derivatives at the record's own values, with residuals extrapolated linearly from there to the common
    # values.
    derivatives: RecordDerivatives
    fit: FitResult  # the record's own values and initial state


def own_derivatives(
    problem: GreyBoxFit, fit: FitResult, free: Sequence[str], most_steps: int, worth_a_step: float
) -> OwnDerivatives | None:
    """Return values and derivatives of one record some Gauss-Newton steps from the common values; None if there was no step.

    A step must be expected to lower the cost by the share `worth_a_step`, and is not taken if no share of it lowers the cost.
    """
    evaluated, start = _at_end(problem, fit, free)
    n_free, coordinates, theta = len(free), evaluated.coordinates, start
    residual, slopes = evaluated.sensitivities(start)[0]
    for _ in range(most_steps):
        size = np.linalg.norm(slopes, axis=0)
        size[size == 0.0] = 1.0
        smallest = max(_LEAST_SLOPE, _MARGIN * evaluated.derivative_error)
        scaled = slopes / size
        step = (
            -np.linalg.pinv(scaled.T @ scaled, rcond=smallest**2, hermitian=True)
            @ (scaled.T @ residual)
            / size
        )
        promised = float(residual @ residual) - float(np.sum((residual + slopes @ step) ** 2))
        if not promised > worth_a_step * float(residual @ residual):
            break
        ahead = None
        for share in _SHARES:
            there = theta + share * step
            there[:n_free] = np.clip(there[:n_free], coordinates.lower, coordinates.upper)
            tried = evaluated.sensitivities(there)[0]
            # A motion that diverges is no improvement.
            with np.errstate(over="ignore", invalid="ignore"):
                if float(tried[0] @ tried[0]) < float(residual @ residual):
                    ahead = tried
                    break
        if ahead is None:
            break
        theta, (residual, slopes) = there, ahead
    if theta is start:
        return None
    p = coordinates.to_parameters(theta[:n_free])
    own = replace(
        fit,
        values={**fit.values, **{name: float(p[coordinates.index[i]]) for i, name in enumerate(free)}},
        initial_states=tuple(evaluated.states(theta)),
    )
    return OwnDerivatives(_of_record(evaluated, 0, (residual - slopes @ (theta - start), slopes)), own)


def _at_end(problem: GreyBoxFit, fit: FitResult, free: Sequence[str]) -> tuple[Problem, Floats]:
    """Return the problem with derivatives by these parameters, and the end of the fit in its coordinates."""
    coordinates = Coordinates.of(problem.data.structure, free, fit.values, problem.scales)
    own = coordinates.from_values(fit.values)
    sizes = problem.data.state_sizes(coordinates.to_parameters(own)[:, None])[:, 0]
    # The range of a limited state may be zero.
    units = np.where(sizes > 0.0, sizes, 1.0)
    theta = np.concatenate([own, *(state / units for state in fit.initial_states)])
    evaluated = Problem(problem.data, coordinates, sizes.size, np.full(theta.size, np.inf))
    evaluated.substeps = list(fit.substeps)
    return evaluated, theta


def _of_record(evaluated: Problem, index: int, sensitivity: tuple[Floats, Floats]) -> RecordDerivatives:
    (residual, slopes), n_free = sensitivity, evaluated.n_free
    measured = int(np.count_nonzero(evaluated.data.records[index].weights))
    return RecordDerivatives(residual, slopes[:, :n_free], slopes[:, n_free:], measured)
