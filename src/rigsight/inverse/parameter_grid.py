"""The values of nonlinear parameters that are tried along the measured motion: a grid, then points beside its best one.

References
----------
T. G. Kolda, R. M. Lewis and V. Torczon, SIAM Review 45 (2003) 385, for compass search.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, placed_dimension
from rigsight.parameters import Parameter
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

POINTS = {0: 1, 1: 6, 2: 4, 3: 3}
"""Points of the grid of each nonlinear parameter, by their number; two points beyond."""
_WAVES = 40
"""Points of the grid of a wave number: between two of them a wave loses its phase at the ends of the motion."""
LEAST_SHARE, MOST_SHARE = 0.02, 3.0
"""Range of the grid in characteristic sizes, within that of a search."""


def grid_of(
    effect: Effect, linear: Sequence[Parameter], scales: Mapping[str, float]
) -> Iterator[dict[str, float]]:
    """Yield the values of all parameters in which an effect is not linear, by their own names."""
    held = {p.name: p.held_at(usual(effect, p, scales)) for p in effect.parameters if not p.fitted}
    if effect.post_yield_stiffness_ratio is not None:
        # It scales the force of the loop: the coefficient of the column tells it, see `Selection`.
        held[effect.post_yield_stiffness_ratio] = 0.0
    inside = [p for p in effect.parameters if p.fitted and p not in linear and p.name not in held]
    grids = _grids(effect, inside, scales)
    for values in itertools.product(*grids.values()):
        yield {**held, **dict(zip(grids, map(float, values), strict=True))}


def beside(
    effect: Effect, inner: Mapping[str, float], scales: Mapping[str, float], halvings: int
) -> Iterator[dict[str, float]]:
    """Yield the points on both sides of one along each parameter, at a step of the grid that was halved so often."""
    ratio = effect.post_yield_stiffness_ratio
    inside = [p for p in effect.parameters if p.fitted and p.name in inner and p.name != ratio]
    for parameter, (name, grid) in zip(inside, _grids(effect, inside, scales).items(), strict=True):
        if grid.size < 2:
            continue
        for way in (-(0.5**halvings), 0.5**halvings):
            step, factor = way * (grid[1] - grid[0]), (grid[1] / grid[0]) ** way
            moved = inner[name] + step if _is_even(effect, parameter) else inner[name] * factor
            if grid[0] <= moved <= grid[-1]:
                yield {**inner, name: float(moved)}


def _grids(effect: Effect, inside: Sequence[Parameter], scales: Mapping[str, float]) -> dict[str, Floats]:
    n = POINTS.get(len(inside), 2)
    return {p.name: _grid(effect, p, scales, n) for p in inside}


def _is_even(effect: Effect, parameter: Parameter) -> bool:
    """Return whether the points of a parameter are evenly spaced: of a wave number, and of an exponent whose sign is open."""
    return parameter.name == effect.wave_number or -MOST_SHARE <= parameter.search[0] < 0.0


def _grid(effect: Effect, parameter: Parameter, scales: Mapping[str, float], n: int) -> Floats:
    if _is_even(effect, parameter):
        n = _WAVES if parameter.name == effect.wave_number else n
        return usual(effect, parameter, scales) * np.linspace(*parameter.search, n)
    low, high = max(parameter.search[0], LEAST_SHARE), min(parameter.search[1], MOST_SHARE)
    return usual(effect, parameter, scales) * np.geomspace(low, 0.97 * high, n)


def usual(effect: Effect, parameter: Parameter, scales: Mapping[str, float]) -> float:
    """Return the size of a parameter in the records, at the place of its effect."""
    return characteristic_value(placed_dimension(effect, parameter.dimension), scales)
