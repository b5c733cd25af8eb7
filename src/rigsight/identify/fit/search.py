"""How a fit searches its minimum: by a bounded trust region, beside it variable projection and steps off kinks.

Variable projection: only the parameters are coordinates, and the initial states of all records are refitted at each step. Windows
of records have far more initial states than parameters, and with stick-slip friction these jump as the parameters change: a joint
step in all coordinates would be rejected, a step followed by refitting each window is not.

Kinks: when a friction slider slips one sample later, the cost has a kink, and a descent along exact derivatives stops at one of
many, depending on rounding. Finite differences over steps as large as the standard errors average over kinks and are continuous
in the parameters and the data: the point at which Gauss-Newton steps from them vanish is stable. Derivatives integrated along
with the motion cannot do this.

References
----------
G. H. Golub and V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; L. Kaufman, BIT 15 (1975) 49, for the projected derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from rigsight.errors import SimulationError
from rigsight.identify.fit.coordinates import STEP, Coordinates
from rigsight.identify.fit.covariance import symmetric_eigen
from rigsight.identify.fit.fit_data import FitData, weighted
from rigsight.identify.fit.fit_problem import Evaluation, Problem
from rigsight.identify.fit.settled_states import SearchStart
from rigsight.records.record import Floats

_DAMPINGS = (0.0, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0)
"""Dampings of the Levenberg-Marquardt steps of an initial state that are tried at once, in units of the normalized equations."""
_ASIDE = (-0.3, 0.3)
"""Shares of its range by which a limited state is moved in further trials: its derivative is zero after it has slipped."""
_FEW_STEPS = 8
_MANY_STEPS = 15
_SETTLED = 1e-3
"""Share of a record's cost below which no further step is made."""
_PLACES = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Start values of limited states between the rounds of a search, as shares of their range."""
_DEPENDENT_STATE = 1e-9
"""Part of the response to an initial state outside that to the others below which they give it no more than rounding."""
_REACH = 30.0
"""Distance of a bound, in units of a coordinate and of its value, from which a search goes on without it; 3 and 10 do nearly
as well."""
_WORTH_GOING_ON = 1e-2
"""Share of the cost by which a full step must be expected to lower it where a search ended; 0.001 does as well, 0.1 gave up in a
valley."""
FINE_TOLERANCE = 1e-6
"""Tolerance above which a search is only a rough one, for which kinks do not matter."""
_VANISHED = 3e-3
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
_DETERMINED = 1e-8
"""Share of the largest influence, squared, below which a combination of states has none on the first samples."""


class VariableProjection(Problem):
    """Cost, gradient and Gauss-Newton matrix as functions of the parameters' coordinates.

    `places` are the initial states of each record in units of their sizes, between `lower` and `upper`, shape (n_states,) each.
    """

    def __init__(
        self,
        data: FitData,
        coordinates: Coordinates,
        places: Sequence[Floats],
        lower: Sequence[Floats],
        upper: Sequence[Floats],
    ) -> None:
        n_states = len(data.structure.states)
        super().__init__(data, coordinates, n_states, np.concatenate([coordinates.upper, *upper]))
        self.places = list(places)
        self._lower, self._upper = lower, upper
        self._settled_at = self.places

    def jacobian(self, theta: Floats) -> Floats:
        """Return the derivatives of `residual`; the search continues from the point where they are requested."""
        self.at(theta)
        self.places = self._settled_at
        return super().jacobian(theta)

    def _evaluation(self, theta: Floats) -> Evaluation:
        """Refit the initial states, then evaluate with their directions projected out of the derivatives."""
        p = self.coordinates.to_parameters(theta)
        settled = self.data.of_each_record(lambda i: self._settled(i, p, self.places[i], _FEW_STEPS)[0])
        n = theta.size
        normal, gradient, cost = np.zeros((n, n)), np.zeros(n), 0.0
        with np.errstate(over="ignore", invalid="ignore"):  # a diverging simulation overflows here
            for residual, derivative in self.sensitivities(np.concatenate([theta, *settled])):
                cost += float(residual @ residual)
                own, rest = _projected(derivative[:, :n], derivative[:, n:], residual)
                normal += own.T @ own
                gradient += own.T @ rest
            cost += self.add_prior(theta, normal, gradient)
        if not (np.isfinite(cost) and np.all(np.isfinite(normal))):
            cost = float("inf")
        self._settled_at = settled
        return Evaluation(theta, cost, normal, gradient)

    def settle_anew(self, theta: Floats) -> float:
        """Refit the initial states from several values of limited states, and return the cost."""
        self._last = None
        p = self.coordinates.to_parameters(theta)

        def best(index: int) -> tuple[Floats, float]:
            place = self.places[index]
            starts = [place]
            if np.any(self.data.limited):
                starts += [np.where(self.data.limited, share, place) for share in _PLACES]
            tried = [self._settled(index, p, start, _MANY_STEPS) for start in starts]
            return min(tried, key=lambda found: found[1])

        found = self.data.of_each_record(best)
        for index, (place, _) in enumerate(found):
            self.places[index] = place
        return sum((cost for _, cost in found), start=0.0)

    def _settled(self, index: int, p: Floats, place: Floats, most: int) -> tuple[Floats, float]:
        """Return the best initial state near a given one, and its cost."""
        n, cost = self.n_states, float("inf")
        low, high = self._lower[index][:, None], self._upper[index][:, None]
        for _ in range(most):
            step = np.where(place + STEP > self._upper[index], -STEP, STEP)
            lanes = place[:, None] + np.column_stack([np.zeros(n), np.diag(step)])
            residuals = self._residuals(index, p, lanes)
            residual = residuals[:, 0]
            with np.errstate(over="ignore", invalid="ignore"):
                cost = float(residual @ residual)
            if not np.isfinite(cost):
                return place, float("inf")
            derivative = np.nan_to_num((residuals[:, 1:] - residuals[:, :1]) / step, posinf=0.0, neginf=0.0)
            tried = np.clip(self._candidates(place, derivative, residual), low, high)
            with np.errstate(over="ignore", invalid="ignore"):
                costs = np.sum(self._residuals(index, p, tried) ** 2, axis=0)
            costs[~np.isfinite(costs)] = np.inf
            best = int(np.argmin(costs))
            if costs[best] >= cost:
                break
            place, gained, cost = tried[:, best], cost - float(costs[best]), float(costs[best])
            if gained < _SETTLED * cost:
                break
        return place, cost

    def _candidates(self, place: Floats, derivative: Floats, residual: Floats) -> Floats:
        """Return initial states to try, shape (n_states, n_lanes)."""
        size = np.linalg.norm(derivative, axis=0)
        size[size == 0.0] = 1.0
        normal = (derivative / size).T @ (derivative / size)
        values, vectors = symmetric_eigen(normal)
        slope = vectors.T @ ((derivative / size).T @ residual)
        steps = [
            (vectors @ (slope / (np.maximum(values, 0.0) + damping + 1e-12))) / size for damping in _DAMPINGS
        ]
        lanes = [place - step for step in steps]
        if np.any(self.data.limited):
            lanes += [np.where(self.data.limited, place + aside, place) for aside in _ASIDE]
        return np.column_stack(lanes)

    def _residuals(self, index: int, p: Floats, places: Floats) -> Floats:
        record = self.data.records[index]
        sets = np.repeat(record.parameters(p)[:, None], places.shape[1], axis=1)
        with np.errstate(all="ignore"):
            states = places * self.data.state_sizes(sets)
            first, against_first = weighted(
                record, self.data.simulated(record, sets, states, self.substeps[index])
            )
            return np.column_stack([first, first[:, None] + against_first])


def _projected(own: Floats, states: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Return derivatives and residual with the directions of the initial states projected out."""
    size = np.linalg.norm(states, axis=0)
    size[size == 0.0] = 1.0
    base, triangle = np.linalg.qr(states / size)
    base = base[:, np.abs(np.diag(triangle)) > _DEPENDENT_STATE]
    return own - base @ (base.T @ own), residual - base @ (base.T @ residual)


def searched(
    problem: Problem, theta: Floats, bounds: tuple[Floats, Floats], tolerance: float, max_evaluations: int
) -> OptimizeResult:
    """Return the result of the optimizer.

    It measures steps in units of the root of the distance to the bound that lies ahead. Where one bound is very far away, the
    other coordinates may move in such small steps that the cost hardly changes, and the search ends although a full step would
    lower it. From there it goes on without the bounds that are far away.
    """
    result = _searched(problem, theta, bounds, tolerance, max_evaluations)
    if result.status <= 0 or problem.removable(result.x) < _WORTH_GOING_ON:
        return result
    reach = _REACH * np.maximum(np.abs(result.x), 1.0)
    within_reach = (
        np.where(result.x - bounds[0] > reach, -np.inf, bounds[0]),
        np.where(bounds[1] - result.x > reach, np.inf, bounds[1]),
    )
    further = _searched(problem, result.x, within_reach, tolerance, max_evaluations)
    is_inside = np.all((further.x >= bounds[0]) & (further.x <= bounds[1]))
    return further if is_inside and further.cost < result.cost else result


def _searched(
    problem: Problem, theta: Floats, bounds: tuple[Floats, Floats], tolerance: float, max_evaluations: int
) -> OptimizeResult:
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


def off_kinks(problem: Problem, theta: Floats, bounds: tuple[Floats, Floats]) -> Floats | None:
    """Return the point near the end of a search where Gauss-Newton steps from long differences vanish."""
    before = problem.at(theta)
    variance = before.cost / max(problem.data.n_readings, 1)
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
        if length <= _VANISHED * np.sqrt(variance):
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
        return weighted(record, data.accurate(record, p, states[index], _EXACT)[:, :, None])[0]

    residuals = data.of_each_record(accurate)
    for index, (_, derivative) in enumerate(problem.sensitivities(place)):
        columns = problem.columns(index)
        cost += float(residuals[index] @ residuals[index])
        normal[np.ix_(columns, columns)] += derivative.T @ derivative
        gradient[columns] += derivative.T @ residuals[index]
    cost += problem.add_prior(place, normal, gradient)
    return Evaluation(place, cost, normal, gradient)


def _step(evaluation: Evaluation, bounds: tuple[Floats, Floats]) -> tuple[Floats, float]:
    """Return a Gauss-Newton step within the bounds, and the change of the residuals, which bounds its size in standard errors."""
    # Coordinates that the step would move beyond a bound are held.
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


class FreeRun(Problem):
    """Cost, gradient and Gauss-Newton matrix as functions of the parameters' coordinates, with states that follow from these.

    `slopes` are the derivatives of the initial states, in units of their sizes, by the coordinates from where the search begins,
    shape (n_states, n_free), of each record.
    """

    def __init__(
        self,
        data: FitData,
        begin: SearchStart,
        slopes: Sequence[Floats],
    ) -> None:
        super().__init__(data, begin.coordinates, 0, begin.coordinates.upper)
        upper = np.concatenate([begin.coordinates.upper, *begin.upper])
        self._whole = Problem(data, begin.coordinates, begin.n_states, upper)
        self._begin, self._slopes = begin, slopes

    def states(self, theta: Floats) -> list[Floats]:
        """Return the initial states per record."""
        return self._whole.states(self._with_states(theta))

    def sensitivities(self, theta: Floats) -> list[tuple[Floats, Floats]]:
        """Return, for each record, the weighted residuals (n,) and their derivatives (n, n_free)."""
        found = self._like_this().sensitivities(self._with_states(theta))
        return [
            (residual, derivative @ _total(slope)[1:, 1:])
            for (residual, derivative), slope in zip(found, self._slopes, strict=True)
        ]

    def _products(self, theta: Floats) -> list[Floats]:
        found = self._like_this()._products(self._with_states(theta))
        return [
            _total(slope).T @ product @ _total(slope)
            for product, slope in zip(found, self._slopes, strict=True)
        ]

    def _with_states(self, theta: Floats) -> Floats:
        begin = self._begin
        moved = theta - begin.theta[: self.n_free]
        states = [
            np.clip(place + slope @ moved, low, high)
            for place, slope, low, high in zip(
                begin.places, self._slopes, begin.lower, begin.upper, strict=True
            )
        ]
        return np.concatenate([theta, *states])

    def _like_this(self) -> Problem:
        """Return the problem with states as coordinates, with the same integration and difference steps."""
        self._whole.substeps = self.substeps
        self._whole.steps[: self.n_free] = self.steps
        return self._whole


def _total(slope: Floats) -> Floats:
    """Return the derivative of residual, coordinates and states by residual and coordinates."""
    n_states, n_free = slope.shape
    return np.vstack([np.eye(1 + n_free), np.hstack([np.zeros((n_states, 1)), slope])])


def state_slopes(
    data: FitData,
    scales: Mapping[str, float],
    values: Mapping[str, float],
    free: Sequence[str],
    states: Sequence[Floats],
) -> list[Floats]:
    """Return the derivatives of the initial states that fit records best, in units of sizes and by coordinates."""
    begin = SearchStart.of(data, scales, values, free, states, as_given=True)
    problem = Problem(data, begin.coordinates, begin.n_states, np.full(begin.theta.size, np.inf))
    problem.choose_substeps(begin.theta)
    normal, n_free = problem.at(begin.theta).normal, len(free)
    if not np.all(np.isfinite(normal)):
        return [np.zeros((begin.n_states, n_free)) for _ in states]
    slopes = []
    for index in range(len(states)):
        own = problem.columns(index)[n_free:]
        answers = normal[np.ix_(own, own)]
        size = np.sqrt(np.where(np.diag(answers) > 0.0, np.diag(answers), 1.0))
        inverse = np.linalg.pinv(answers / np.outer(size, size), rcond=_DETERMINED, hermitian=True)
        slopes.append(-(inverse @ (normal[own, :n_free] / size[:, None])) / size[:, None])
    return slopes
