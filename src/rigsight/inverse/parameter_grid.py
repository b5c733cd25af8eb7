"""The values of the nonlinear parameters of an effect that are tried along the measured motion."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, placed_dimension
from rigsight.parameters import Parameter
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

POINTS = {0: 1, 1: 6, 2: 4}
"""Points of the grid of each nonlinear parameter, by their number; two points beyond."""
_WAVES = 40
"""Points of the grid of a wave number: between two of them a wave loses its phase at the ends of the motion."""
LEAST_SHARE, MOST_SHARE = 0.02, 3.0
"""Range of the grid in characteristic sizes, within that of a search."""


def grid_of(
    effect: Effect, linear: Sequence[Parameter], scales: Mapping[str, float]
) -> Iterator[dict[str, float]]:
    """Yield the values of all parameters in which an effect is not linear, by their own names."""
    inside = [p for p in effect.parameters if p.fitted and p not in linear]
    held = {p.name: p.held_at(usual(effect, p, scales)) for p in effect.parameters if not p.fitted}
    n = POINTS.get(len(inside), 2)
    grids = [
        _waves(effect, p, scales) if p.name == effect.wave_number else _grid(effect, p, scales, n)
        for p in inside
    ]
    for values in itertools.product(*grids):
        yield {**held, **dict(zip((p.name for p in inside), map(float, values), strict=True))}


def _grid(effect: Effect, parameter: Parameter, scales: Mapping[str, float], n: int) -> Floats:
    low, high = max(parameter.search[0], LEAST_SHARE), min(parameter.search[1], MOST_SHARE)
    return usual(effect, parameter, scales) * np.geomspace(low, 0.97 * high, n)


def _waves(effect: Effect, parameter: Parameter, scales: Mapping[str, float]) -> Floats:
    return usual(effect, parameter, scales) * np.linspace(*parameter.search, _WAVES)


def usual(effect: Effect, parameter: Parameter, scales: Mapping[str, float]) -> float:
    """Return the size of a parameter in the records, at the place of its effect."""
    return characteristic_value(placed_dimension(effect, parameter.dimension), scales)
