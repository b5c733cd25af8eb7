"""Optimizer of a fit: a bounded trust region, with coarse finite differences where friction sliders make the cost nonsmooth.

When a slider slips one sample later, the cost has a kink, and a descent along exact derivatives stops at one of many kinks,
depending on rounding. Finite differences over steps as large as the standard errors average over kinks and are continuous in the
parameters and the data: the point at which Gauss-Newton steps from them vanish is stable. Derivatives integrated along with the
motion cannot do this.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import OptimizeResult, least_squares

from rigsight.errors import SimulationError
from rigsight.identify.fit.coordinates import STEP
from rigsight.identify.fit.fit_data import weighted
from rigsight.identify.fit.fit_problem import Evaluation, Problem
from rigsight.simulate import simulate_outputs

FINE_TOLERANCE = 1e-6
"""A search that stops at larger changes of the cost is only a rough one, for which kinks do not matter."""
_SETTLED = 3e-3
"""Length of a step, in standard errors, after which no more are made: with steps that halve, a hundredth is left at most."""
_MOST_STEPS = 20
"""Five did where steps shrink by themselves; where two places answer each other, halved steps need about twice as many."""
_LEAST_SHARE = 0.1
_LESS, _MORE = 0.5, 1.5
"""Factors of the share of a step that is taken, where it turns back and where it does not: the usual ones, not adjusted."""
_DEPENDENT = 1e-7
"""Share of the largest influence below which a combination of coordinates has none: squares are known to 1e-16."""
_WIDEST = 0.1
"""Share of a coordinate's range that a difference spans at most."""
_EXACT = 1e-6
"""Relative accuracy of the residuals: with integration steps whose number is chosen by a limit that rounding can cross the same
records gave numbers that differed by a twentieth of a standard error. Derivatives need no such care."""
_WORST = 1.0
"""By how many squared standard errors of white noise the cost may rise on the way to where differences vanish: they see no
more than that."""


def searched(
    problem: Problem,
    theta: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    tolerance: float,
    max_evaluations: int,
) -> OptimizeResult:
    """Return where the optimizer ends."""
    return least_squares(
        problem.residual,
        theta,
        jac=problem.jacobian,
        bounds=bounds,
        method="trf",
        x_scale="jac",
        ftol=tolerance,
        xtol=0.1 * tolerance,
        gtol=1e-3 * tolerance,
        max_nfev=max_evaluations,
    )


def off_kinks(
    problem: Problem,
    theta: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    n_samples: int,
) -> NDArray[np.float64] | None:
    """Return the place near the end of a search where Gauss-Newton steps made of long differences vanish.

    Parameters
    ----------
    problem
        The fit.
    theta, bounds
        Where the search ended, and its bounds, shape (n,) each.
    n_samples
        Measured samples, which tell the size of the noise.

    Returns
    -------
    Shape (n,); None where the steps lead to a higher cost or come to no end.
    """
    before = problem.at(theta)
    variance = before.cost / max(n_samples, 1)
    if not (np.isfinite(before.cost) and variance > 0.0):
        return None
    problem.steps = _differences(before, bounds, variance)
    try:
        return _settled(problem, theta, bounds, variance)
    except SimulationError:
        return None
    finally:
        problem.steps = np.full(theta.size, STEP)


def _settled(
    problem: Problem,
    theta: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    variance: float,
) -> NDArray[np.float64] | None:
    """Return where the steps vanish; None if they do not, or at a higher cost."""
    place, share, last, first = theta, 1.0, np.zeros(theta.size), float("inf")
    for _ in range(_MOST_STEPS):
        evaluation = _evaluated(problem, place)
        if not np.isfinite(evaluation.cost) or not np.all(np.isfinite(evaluation.normal)):
            return None
        first = min(first, evaluation.cost)
        step, length = _step(evaluation, bounds)
        if length <= _SETTLED * np.sqrt(variance):
            return place if evaluation.cost <= first + _WORST * variance else None
        # Beside a kink each of two places may send the search to the other one.
        returns = float((step / problem.steps) @ (last / problem.steps)) < 0.0
        share = max(_LESS * share, _LEAST_SHARE) if returns else min(_MORE * share, 1.0)
        place, last = place + share * step, step
        problem.steps = _differences(evaluation, bounds, variance)
    return None


def _differences(
    evaluation: Evaluation, bounds: tuple[NDArray[np.float64], NDArray[np.float64]], variance: float
) -> NDArray[np.float64]:
    """Return a standard error of each coordinate with all others held; one without influence keeps the derivative's step."""
    curvature = np.diag(evaluation.normal)
    error = np.sqrt(variance / np.maximum(curvature, 1e-300))
    widest = np.maximum(_WIDEST * (bounds[1] - bounds[0]), STEP)
    return np.where(curvature > 0.0, np.clip(error, STEP, widest), STEP)


def _evaluated(problem: Problem, place: NDArray[np.float64]) -> Evaluation:
    """Return the equations of a step: accurate residuals, and derivatives by long differences."""
    data, n = problem.data, place.size
    p = problem.coordinates.to_parameters(place[: problem.n_free])
    states = problem.states(place)
    normal, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0

    def accurate(index: int) -> NDArray[np.float64]:
        record = data.records[index]
        n_samples = record.record.n_samples
        own = record.parameters(p)
        out = simulate_outputs(data.structure, record.held, own, states[index], n_samples, _EXACT)
        return weighted(record, out[:, :, None])[0]

    residuals = data.of_each_record(accurate)
    for index, (_, derivative) in enumerate(problem.sensitivities(place)):
        columns = problem.columns(index)
        cost += float(residuals[index] @ residuals[index])
        normal[np.ix_(columns, columns)] += derivative.T @ derivative
        gradient[columns] += derivative.T @ residuals[index]
    return Evaluation(place, cost, normal, gradient)


def _step(
    evaluation: Evaluation, bounds: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> tuple[NDArray[np.float64], float]:
    """Return a Gauss-Newton step within the bounds and how much it changes the residuals, which bounds it in standard errors.

    Coordinates that it pushes against a bound are held.
    """
    place = evaluation.theta
    root, projection = evaluation.compressed
    free = np.ones(place.size, dtype=bool)
    step = np.zeros(place.size)
    for _ in range(place.size):
        step = np.zeros(place.size)
        step[free] = -np.linalg.lstsq(root[:, free], projection, rcond=_DEPENDENT)[0]
        beyond = free & ((place + step > bounds[1]) | (place + step < bounds[0]))
        if not np.any(beyond):
            break
        free &= ~beyond
    step = np.clip(place + step, *bounds) - place
    return step, float(np.linalg.norm(root @ step))
