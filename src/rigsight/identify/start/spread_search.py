"""Search over decades: starts around sizes at which the terms of the equations balance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.parameters import Parameter
from rigsight.records.record import Floats

_SPREADS = (1.5, 4.0)
"""Standard deviations of the starts in natural logarithms, in turn: parameters of comparable terms differ from their expected
size by less than a decade, those of small terms or unmeasured motions by two."""
_REACH = 16.0
"""Largest distance of a logarithm from its expected value, seven decades; records cannot determine a value beyond."""
_TOLD = 1.0
"""Change of all errors together, of size one each, due to a unit step of a coordinate, above which the records determine it."""
_MARGIN = 1e-9
_DEFAULT = 30.0
"""Weight of a default relative to that of the balance of one term."""
_BALANCINGS = 5
_FARTHEST = 40.0
"""Largest logarithm of any size, in SI units."""
_WITHIN = 2.3
"""Expected distance of a logarithm from its bounds, a decade."""
_PULL = 0.02
"""Weight of the expected size relative to an error of size one: it determines only what the records do not."""
_SCREENED, _FOLLOWED, AGREEING = 300, 12, 3
"""Number of starts of which the errors are computed, number of those from which a search continues, and number of searches that
must end in the lowest minimum for it to count as the global one."""
PERSISTENT = _FOLLOWED
"""Number of agreeing searches with which all starts are followed, used if no minimum explains the records."""
_AS_LOW = 1.01
"""Ratio of two costs below which two minima count as the same: they may differ along directions that records do not determine."""
_MOST_EVALUATIONS = 60


@dataclass(frozen=True)
class SearchSpace:
    """Coordinates of unknown parameters: logarithms of those with one sign, others in units of their size."""

    parameters: tuple[Parameter, ...]  # the unknown parameters
    # The expected value of each, or the expected size of one that may have either sign, shape (n_parameters,).
    expected: Floats

    @property
    def logarithmic(self) -> NDArray[np.bool_]:
        """True for parameters with one sign."""
        return np.array([p.lower >= 0.0 or p.upper <= 0.0 for p in self.parameters], dtype=bool)

    def values(self, theta: Floats) -> Floats:
        """Return the parameters at coordinates within their bounds; both of shape (n_parameters,)."""
        sign = np.array([-1.0 if p.upper <= 0.0 else 1.0 for p in self.parameters])
        own = np.where(self.logarithmic, sign * np.abs(self.expected) * np.exp(theta), self.expected * theta)
        return np.clip(own, [p.lower for p in self.parameters], [p.upper for p in self.parameters])

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the lowest and highest coordinates, shape (n_parameters,) each, from bounds and largest distances."""
        sign = np.array([-1.0 if p.upper <= 0.0 else 1.0 for p in self.parameters])
        ends = np.array([[p.lower, p.upper] for p in self.parameters]) / np.abs(self.expected)[:, None]
        ends = np.sort(np.where(self.logarithmic, sign, 1.0)[:, None] * ends, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(self.logarithmic[:, None], np.log(np.maximum(ends, 0.0)), ends)
        first = self.start()
        low = np.clip(ends[:, 0], first - _REACH, first)
        high = np.clip(ends[:, 1], first, first + _REACH)
        # A search needs a start strictly inside the bounds.
        return low - _MARGIN, high + _MARGIN

    def start(self) -> Floats:
        """Return the coordinates of the expected values; a parameter that may have either sign is zero, or its default."""
        defaults = [p.default for p in self.parameters]
        of_others = [0.0 if d is None else d / e for d, e in zip(defaults, self.expected, strict=True)]
        return np.where(self.logarithmic, 0.0, of_others)


def balanced(
    parameters: Sequence[Parameter], terms: Callable[[Floats], Sequence[tuple[int, float, Floats]]]
) -> SearchSpace:
    """Return a space about the values at which the terms of each equation have equal size, as far as that is possible."""
    prior = np.array([np.log(abs(p.default)) if p.default else 0.0 for p in parameters])
    # A default has more weight than any term; without one, the size 1 determines only what no equation does.
    weight = np.array([_DEFAULT if p.default else 1e-3 for p in parameters])
    low = np.array([np.log(p.lower) + _WITHIN if p.lower > 0.0 else -np.inf for p in parameters])
    high = np.array([np.log(p.upper) - _WITHIN if 0.0 < p.upper < np.inf else np.inf for p in parameters])
    logs = prior.copy()
    # Repeated, because the powers in sums of parameters depend on their sizes, and a bound affects other parameters.
    for _ in range(_BALANCINGS):
        found = [term for term in terms(np.exp(logs)) if term[1] > 0.0 and np.isfinite(term[1])]
        equations = sorted({equation for equation, _, _ in found})
        rows, right = [], []
        for equation, size, powers in found:
            middle = -np.eye(len(equations))[equations.index(equation)]
            rows.append(np.concatenate([powers, middle]))
            right.append(float(powers @ logs) - np.log(size))
        n, n_all = len(parameters), len(parameters) + len(equations)
        rows += list(np.hstack([np.diag(weight), np.zeros((n, len(equations)))]))
        right += list(weight * prior)
        solved = np.linalg.lstsq(np.array(rows).reshape(-1, n_all), np.array(right), rcond=None)[0]
        logs = np.clip(solved[:n], -_FARTHEST, _FARTHEST)
        beyond = (logs < low) | (logs > high)
        prior = np.where(beyond, np.clip(logs, low, high), prior)
        weight = np.where(beyond, 1.0, weight)
    return SearchSpace(tuple(parameters), np.exp(np.maximum(np.minimum(logs, high), low)))


def ends_of_search(
    space: SearchSpace, errors: Callable[[Floats], Floats], rng: np.random.Generator, agreeing: int = AGREEING
) -> list[tuple[float, Floats]]:
    """Return the local minima of a sum of squared errors reached from many starts, lowest first: cost and parameter values."""
    first = space.start()
    spreads = [_SPREADS[i % len(_SPREADS)] for i in range(_SCREENED)]
    thetas = [first, *(first + spread * rng.standard_normal(first.size) for spread in spreads)]
    # This sum stays finite for a start that is far off.
    costs = [float(np.sum(np.log1p(errors(space.values(theta)) ** 2))) for theta in thetas]
    found: list[tuple[float, Floats]] = []
    for index in np.argsort(costs)[:_FOLLOWED]:
        found.append(_descent(space, errors, thetas[index], first))
        lowest = min(cost for cost, _ in found)
        if sum(cost <= _AS_LOW * lowest for cost, _ in found) >= agreeing:
            break
    ends: list[tuple[float, Floats]] = []
    for cost, theta in sorted(found, key=lambda end: end[0]):
        if all(cost > _AS_LOW * other for other, _ in ends):
            ends.append((cost, theta))
    return [(cost, space.values(theta)) for cost, theta in ends]


def _descent(
    space: SearchSpace, errors: Callable[[Floats], Floats], start: Floats, expected: Floats
) -> tuple[float, Floats]:
    def pulled(theta: Floats) -> Floats:
        return np.concatenate([errors(space.values(theta)), _PULL * (theta - expected)])

    bounds = space.bounds()
    found = least_squares(
        pulled,
        np.clip(start, bounds[0] + 1e-10, bounds[1] - 1e-10),
        bounds=bounds,
        x_scale=1.0,
        max_nfev=_MOST_EVALUATIONS,
        ftol=1e-4,
        xtol=1e-4,
    )
    # A descent does not change directions that records do not determine; along these, return to the expected values.
    own = np.asarray(found.jac)[: -start.size]
    _, sizes, directions = np.linalg.svd(own, full_matrices=False)
    untold = directions[sizes < _TOLD]
    back = np.clip(found.x - untold.T @ (untold @ (found.x - expected)), *bounds)
    cost, cost_back = float(np.sum(found.fun**2)), float(np.sum(pulled(back) ** 2))
    return (cost_back, back) if cost_back <= cost + _TOLD else (cost, found.x)
