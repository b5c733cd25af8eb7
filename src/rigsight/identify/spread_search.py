"""Where may a search over decades start, and where does it end? Starts about sizes at which the terms of equations balance."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.parameters import Parameter

Floats = NDArray[np.float64]

_SPREAD = 2.0
"""Standard deviation of the starts in natural logarithms, nearly a decade: terms of an equation that matter differ by less."""
_REACH = 16.0
"""How far a logarithm may go from where it is expected, seven decades; beyond lies nothing that records tell."""
_PULL = 0.02
"""Weight of the expected size beside one error of size one: it decides what records do not tell, and nothing else."""
_SCREENED, _FOLLOWED, _AGREEING = 200, 10, 3
"""Starts of which the errors are computed, those from which a search goes on, and how many of these must lead to the lowest
place for it to be taken as the lowest of all."""
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
    logs = prior.copy()
    # Sums of parameters have powers that depend on their sizes.
    for _ in range(3):
        found = [term for term in terms(np.exp(logs)) if term[1] > 0.0 and np.isfinite(term[1])]
        equations = sorted({equation for equation, _, _ in found})
        rows, right = [], []
        for equation, size, powers in found:
            middle = -np.eye(len(equations))[equations.index(equation)]
            rows.append(np.concatenate([powers, middle]))
            right.append(float(powers @ logs) - np.log(size))
        n, n_all = len(parameters), len(parameters) + len(equations)
        # A default is as good as any other term; without one the size 1 only decides what no equation does.
        weight = np.array([1.0 if p.default else 1e-3 for p in parameters])
        rows += list(np.hstack([np.diag(weight), np.zeros((n, len(equations)))]))
        right += list(weight * prior)
        solved = np.linalg.lstsq(np.array(rows).reshape(-1, n_all), np.array(right), rcond=None)[0]
        logs = np.clip(solved[:n], -30.0, 30.0)
    expected = np.exp(logs)
    low = np.array([p.lower if p.lower > 0.0 else 0.0 for p in parameters])
    high = np.array([p.upper if p.upper > 0.0 else np.inf for p in parameters])
    return SearchSpace(tuple(parameters), np.clip(expected, low, high))


def ends_of_search(
    space: SearchSpace,
    errors: Callable[[Floats], Floats],
    rng: np.random.Generator,
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
    """
    first = space.start()
    thetas = [first, *(first + _SPREAD * rng.standard_normal(first.size) for _ in range(_SCREENED))]
    costs = [_cost(errors(space.values(theta))) for theta in thetas]
    found: list[tuple[float, Floats]] = []
    for index in np.argsort(costs)[:_FOLLOWED]:
        found.append(_descent(space, errors, thetas[index], first))
        lowest = min(cost for cost, _ in found)
        if sum(cost <= _AS_LOW * lowest for cost, _ in found) >= _AGREEING:
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

    low, high = expected - _REACH, expected + _REACH
    found = least_squares(
        pulled,
        np.clip(start, low + 1e-6, high - 1e-6),
        bounds=(low, high),
        x_scale=1.0,
        max_nfev=_MOST_EVALUATIONS,
        ftol=1e-4,
        xtol=1e-4,
    )
    return float(np.sum(found.fun**2)), found.x


def _cost(errors: Floats) -> float:
    """Return a sum that a start far off does not make infinite and that still tells better from worse."""
    return float(np.sum(np.log1p(errors**2)))
