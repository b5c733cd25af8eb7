"""The free run as an objective: initial states follow from the first samples, so that only the parameters are coordinates.

The first samples give the initial state for any parameters. Near given ones it changes linearly with them, and the derivatives
of the free run are total ones. The search is repeated from where it ended until that no longer matters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.identify.fit.fit_data import FitData
from rigsight.identify.fit.fit_problem import Problem
from rigsight.identify.fit.settled_states import SearchStart
from rigsight.records.record import Floats

_DETERMINED = 1e-8
"""Share of the largest influence, squared, below which a combination of states has none on the first samples."""


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
