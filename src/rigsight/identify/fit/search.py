"""Optimizer of a fit: a bounded trust region, with coarse finite differences where friction sliders make the cost nonsmooth.

When a slider slips one sample later, the cost has a kink, and a descent along exact derivatives stops at one of many kinks,
depending on rounding. Finite differences over steps as large as the standard errors average over kinks and are continuous in the
parameters and the data: the point at which Gauss-Newton steps from them vanish is stable. Derivatives integrated along with the
motion cannot do this.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from rigsight.errors import SimulationError
from rigsight.identify.fit.coordinates import STEP
from rigsight.identify.fit.fit_data import weighted
from rigsight.identify.fit.fit_problem import Evaluation, Problem
from rigsight.records.record import Floats
from rigsight.simulate import simulate_outputs

FINE_TOLERANCE = 1e-6
"""Tolerance above which a search is only a rough one, for which kinks do not matter."""
_SETTLED = 3e-3
"""Length of a step, in standard errors, at which the search ends: with steps that halve, at most a hundredth remains."""
_MOST_STEPS = 20
"""Five were enough if steps shrink by themselves; if the search alternates between two points, halved steps need about twice as
many."""
_LEAST_SHARE = 0.1
_LESS, _MORE = 0.5, 1.5
"""Factors on the share of a step that is taken, if the step reverses and if it does not: the usual values, not tuned."""
_LEAST_INFLUENCE = 1e-7
"""Share of the largest influence below which a combination of coordinates has none: squares are accurate to 1e-16."""
_WIDEST = 0.1
"""Largest share of a coordinate's range that a difference spans."""
_EXACT = 1e-6
"""Relative accuracy of the residuals. With a chosen number of integration steps, which rounding can change, estimates from the
same records differed by a twentieth of a standard error. Derivatives need not be as accurate."""
_WORST = 1.0
"""Largest increase of the cost, in squared standard errors of white noise, on the way to the point where the differences vanish,
which cannot resolve less."""


def searched(
    problem: Problem, theta: Floats, bounds: tuple[Floats, Floats], tolerance: float, max_evaluations: int
) -> OptimizeResult:
    """Return the result of the optimizer."""
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
    problem: Problem, theta: Floats, bounds: tuple[Floats, Floats], n_samples: int
) -> Floats | None:
    """Return the point near the end of a search where Gauss-Newton steps from long differences vanish."""
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
    problem: Problem, theta: Floats, bounds: tuple[Floats, Floats], variance: float
) -> Floats | None:
    """Return the point where the steps vanish; None if they do not, or only at a higher cost."""
    place, share, last, first = theta, 1.0, np.zeros(theta.size), float("inf")
    for _ in range(_MOST_STEPS):
        evaluation = _evaluated(problem, place)
        if not np.isfinite(evaluation.cost) or not np.all(np.isfinite(evaluation.normal)):
            return None
        first = min(first, evaluation.cost)
        step, length = _step(evaluation, bounds)
        if length <= _SETTLED * np.sqrt(variance):
            return place if evaluation.cost <= first + _WORST * variance else None
        # Near a kink the search may alternate between two points.
        returns = float((step / problem.steps) @ (last / problem.steps)) < 0.0
        share = max(_LESS * share, _LEAST_SHARE) if returns else min(_MORE * share, 1.0)
        place, last = place + share * step, step
        problem.steps = _differences(evaluation, bounds, variance)
    return None


def _differences(evaluation: Evaluation, bounds: tuple[Floats, Floats], variance: float) -> Floats:
    """Return the standard error of each coordinate with all others held; a coordinate without influence keeps the small step."""
    curvature = np.diag(evaluation.normal)
    error = np.sqrt(variance / np.maximum(curvature, 1e-300))
    widest = np.maximum(_WIDEST * (bounds[1] - bounds[0]), STEP)
    return np.where(curvature > 0.0, np.clip(error, STEP, widest), STEP)


def _evaluated(problem: Problem, place: Floats) -> Evaluation:
    """Return the equations of a step: accurate residuals, and derivatives by long differences."""
    data, n = problem.data, place.size
    p = problem.coordinates.to_parameters(place[: problem.n_free])
    states = problem.states(place)
    normal, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0

    def accurate(index: int) -> Floats:
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


def _step(evaluation: Evaluation, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
    """Return a Gauss-Newton step within the bounds, and the change of the residuals, which bounds its size in standard errors.

    Coordinates that the step would move beyond a bound are held.
    """
    place = evaluation.theta
    root, projection = evaluation.compressed
    free = np.ones(place.size, dtype=bool)
    step = np.zeros(place.size)
    for _ in range(place.size):
        step = np.zeros(place.size)
        step[free] = -np.linalg.lstsq(root[:, free], projection, rcond=_LEAST_INFLUENCE)[0]
        beyond = free & ((place + step > bounds[1]) | (place + step < bounds[0]))
        if not np.any(beyond):
            break
        free &= ~beyond
    step = np.clip(place + step, *bounds) - place
    return step, float(np.linalg.norm(root @ step))
