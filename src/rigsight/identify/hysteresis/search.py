"""Global search over the whole range of the parameters: differential evolution with all sets side by side."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from rigsight.errors import InputError
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.records.record import Floats

_APART = 0.1
"""Distance in the unit cube above which two ends of a search count as different."""

_EVENLY = 0.1
"""Characteristic units up to which a range is spaced evenly."""
_UNUSABLE = 1e100
"""Cost of a set that cannot be simulated; its square is still finite."""

Cost = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class SearchBox:
    """Maps the unit cube to search coordinates.

    Ranges in characteristic units are spaced by their inverse hyperbolic sine: evenly up to a tenth of a unit, by decades
    beyond.
    """

    # Range of each coordinate, shape (n_free,).
    lower: Floats
    upper: Floats

    @classmethod
    def around(cls, coordinates: Coordinates, center: Floats, spread: float) -> SearchBox:
        """Take the declared range of a parameter if it has one, else a range around `center`."""
        structure = coordinates.structure
        of_rig = {p.name for p in structure.rig.parameters}
        lower, upper = coordinates.lower.copy(), coordinates.upper.copy()
        for i, name in enumerate(coordinates.free):
            if name not in of_rig:
                continue
            reach = np.log(spread) if coordinates.logarithmic[i] else spread * max(1.0, abs(center[i]))
            lower[i], upper[i] = max(lower[i], center[i] - reach), min(upper[i], center[i] + reach)
        split = coordinates.split
        if split is not None:
            # Both are parts of one stiffness, and only the total is known from the start.
            whole = np.exp(center[split.stiffness]) + center[split.share]
            lower[split.stiffness], upper[split.stiffness] = np.log(whole / spread), np.log(whole * spread)
            lower[split.share], upper[split.share] = 0.0, whole * spread
        return cls(lower, upper)

    def coordinates(self, places: Floats) -> Floats:
        """Return the search coordinates of points in the unit cube, both of shape (..., n_free)."""
        low, high = np.arcsinh(self.lower / _EVENLY), np.arcsinh(self.upper / _EVENLY)
        return np.asarray(_EVENLY * np.sinh(low + places * (high - low)))


def search(
    cost: Cost,
    box: SearchBox,
    rng: np.random.Generator,
    *,
    n_generations: int = 100,
    n_sets: int = 96,
    n_ends: int = 8,
    progress: Callable[[int], None] = lambda _: None,
) -> Floats:
    """Search the lowest cost over the whole box; return the coordinates of its ends, best first, shape (n_ends, n_free)."""
    n_free = box.lower.size
    seen: list[Floats] = []
    paid: list[Floats] = []

    def of_places(places: Floats) -> Floats:
        sets = np.atleast_2d(places.T)
        costs = cost(box.coordinates(sets))
        usable = np.where(np.isfinite(costs), np.minimum(costs, _UNUSABLE), _UNUSABLE)
        seen.append(sets)
        paid.append(usable)
        return usable

    generations = itertools.count(1)

    def count_generation(*_: object) -> None:
        progress(next(generations))

    # scipy's stubs do not know that a vectorized cost returns one value per column.
    vectorized: Any = of_places
    differential_evolution(
        vectorized,
        Bounds(np.zeros(n_free), np.ones(n_free)),
        strategy="currenttobest1bin",
        init=_sobol(n_sets, n_free, rng),
        maxiter=n_generations,
        tol=1e-4,
        mutation=(0.4, 0.9),
        recombination=0.9,
        rng=rng,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=count_generation,
    )
    # The population ends in one basin, which may be wrong because the simulation is coarse; other basins were visited before.
    places, costs = np.concatenate(seen), np.concatenate(paid)
    kept = _different(places, costs, n_ends)
    usable = [place for place in kept if costs[place] < _UNUSABLE]
    if not usable:
        raise InputError(
            "No parameter set in the search range can be simulated. Give better start values or a smaller spread."
        )
    return box.coordinates(places[usable])


def _sobol(n_sets: int, n_free: int, rng: np.random.Generator) -> Floats:
    sampler = qmc.Sobol(n_free, rng=rng)
    return np.asarray(sampler.random_base2(int(np.ceil(np.log2(n_sets)))))[:n_sets]


def _different(places: Floats, costs: Floats, most: int) -> list[int]:
    """Return the indices of the best points that differ from each other, best first."""
    kept: list[int] = []
    for i in np.argsort(costs):
        if all(np.max(np.abs(places[i] - places[j])) > _APART for j in kept):
            kept.append(int(i))
        if len(kept) == most:
            break
    return kept
