"""Search over decades: starts around sizes at which the terms of the equations balance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.parameters import Parameter

Floats = NDArray[np.float64]

_SPREADS = (1.5, 4.0)
"""Standard deviations of the starts in natural logarithms, in turn: terms that matter as much as each other differ by less than a
decade, what hardly matters or moves unseen by two."""
_REACH = 16.0
"""How far a logarithm may go from where it is expected, seven decades; beyond lies nothing that records tell."""
_TOLD = 1.0
"""Change of all errors together, of size one each, that a step of one in a coordinate must make for the records to tell it."""
_MARGIN = 1e-9
_DEFAULT = 30.0
"""Weight of a default beside the wish that a term is as large as others."""
_BALANCINGS = 5
_FARTHEST = 40.0
"""Largest logarithm of any size, in SI units."""
_WITHIN = 2.3
"""How far inside its bounds a logarithm is expected, a decade."""
_PULL = 0.02
"""Weight of the expected size beside one error of size one: it decides what records do not tell, and nothing else."""
_SCREENED, _FOLLOWED, AGREEING = 300, 12, 3
"""Starts of which the errors are computed, those from which a search goes on, and how many of these must lead to the lowest
place for it to be taken as the lowest of all."""
PERSISTENT = _FOLLOWED
"""Number of agreeing searches for one that follows all its starts: where what was found does not explain the records."""
_AS_LOW = 1.01
"""Ratio of two costs below which two ends are as low: along what records do not tell they differ in nothing else."""
_MOST_EVALUATIONS = 60


@dataclass(frozen=True)
class SearchSpace:
    """Coordinates of unknown parameters: logarithms of those that have one sign, others in units of their size.

    Attributes
    ----------
    parameters
        The unknown ones.
    expected
        The value that each has for want of better, the size of those that may have either sign.
    """

    parameters: tuple[Parameter, ...]
    expected: Floats

    @property
    def logarithmic(self) -> NDArray[np.bool_]:
        """Which parameters have one sign."""
        return np.array([p.lower >= 0.0 or p.upper <= 0.0 for p in self.parameters], dtype=bool)

    def values(self, theta: Floats) -> Floats:
        """Return the parameters at coordinates within their bounds; both of shape (n_parameters,)."""
        sign = np.array([-1.0 if p.upper <= 0.0 else 1.0 for p in self.parameters])
        own = np.where(self.logarithmic, sign * np.abs(self.expected) * np.exp(theta), self.expected * theta)
        return np.clip(own, [p.lower for p in self.parameters], [p.upper for p in self.parameters])

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the lowest and highest coordinates, shape (n_parameters,) each: bounds of parameters, and what is too far."""
        sign = np.array([-1.0 if p.upper <= 0.0 else 1.0 for p in self.parameters])
        ends = np.array([[p.lower, p.upper] for p in self.parameters]) / np.abs(self.expected)[:, None]
        ends = np.sort(np.where(self.logarithmic, sign, 1.0)[:, None] * ends, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.where(self.logarithmic[:, None], np.log(np.maximum(ends, 0.0)), ends)
        first = self.start()
        low = np.clip(ends[:, 0], first - _REACH, first)
        high = np.clip(ends[:, 1], first, first + _REACH)
        # A start at a bound lies inside by as much as a search needs.
        return low - _MARGIN, high + _MARGIN

    def start(self) -> Floats:
        """Return the coordinates of what is expected; a number that may have either sign is zero, or its default."""
        defaults = [p.default for p in self.parameters]
        of_others = [0.0 if d is None else d / e for d, e in zip(defaults, self.expected, strict=True)]
        return np.where(self.logarithmic, 0.0, of_others)


def balanced(
    parameters: Sequence[Parameter],
    terms: Callable[[Floats], Sequence[tuple[int, float, Floats]]],
) -> SearchSpace:
    """Return a space about the values at which the terms of each equation are as large as each other, as far as that can be.

    Parameters
    ----------
    parameters
        The unknown ones.
    terms
        For values of them each term's equation, size and powers of the parameters in it.
    """
    prior = np.array([np.log(abs(p.default)) if p.default else 0.0 for p in parameters])
    # A default counts more than any other term; without one the size 1 only decides what no equation does.
    weight = np.array([_DEFAULT if p.default else 1e-3 for p in parameters])
    low = np.array([np.log(p.lower) + _WITHIN if p.lower > 0.0 else -np.inf for p in parameters])
    high = np.array([np.log(p.upper) - _WITHIN if 0.0 < p.upper < np.inf else np.inf for p in parameters])
    logs = prior.copy()
    # Sums of parameters have powers that depend on their sizes, and a bound moves others with it.
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
    space: SearchSpace,
    errors: Callable[[Floats], Floats],
    rng: np.random.Generator,
    agreeing: int = AGREEING,
) -> list[tuple[float, Floats]]:
    """Return the local minima of a sum of squared errors that many starts lead to, lowest first: cost and parameter values.

    Parameters
    ----------
    space
        Where to look.
    errors
        Errors of size one where noise alone makes them, of parameter values.
    rng
        Source of the starts.
    agreeing
        How many searches must lead to the lowest place for it to be taken as the lowest of all.
    """
    first = space.start()
    spreads = [_SPREADS[i % len(_SPREADS)] for i in range(_SCREENED)]
    thetas = [first, *(first + spread * rng.standard_normal(first.size) for spread in spreads)]
    costs = [_cost(errors(space.values(theta))) for theta in thetas]
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
    # A descent ends where nothing is gained; what records do not tell is then still where it began.
    own = np.asarray(found.jac)[: -start.size]
    _, sizes, directions = np.linalg.svd(own, full_matrices=False)
    untold = directions[sizes < _TOLD]
    back = np.clip(found.x - untold.T @ (untold @ (found.x - expected)), *bounds)
    cost, cost_back = float(np.sum(found.fun**2)), float(np.sum(pulled(back) ** 2))
    return (cost_back, back) if cost_back <= cost + _TOLD else (cost, found.x)


def _cost(errors: Floats) -> float:
    """Return a sum that a start far off does not make infinite and that still tells better from worse."""
    return float(np.sum(np.log1p(errors**2)))
