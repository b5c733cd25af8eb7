"""The values of nonlinear parameters that are tried along the measured motion: a grid, then points beside its best one.

References
----------
T. G. Kolda, R. M. Lewis and V. Torczon, SIAM Review 45 (2003) 385, for compass search.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, SumAndDifference, placed_dimension
from rigsight.parameters import Parameter
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

POINTS = {0: 1, 1: 6, 2: 4, 3: 3}
"""Points of the grid of each nonlinear parameter, by their number; two points beyond."""
_OF_PAIRS = 5
"""Points of the sum and of the difference of two parameters that are searched so."""
_WITHIN = (0.3, 0.1)
"""Least size of a sum or difference in characteristic units, and share of its range where the grid ends: at the very ends a loop
is only a spring, or vanishes."""
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
    held |= {name: effect.special_cases[name] for name in _exponents(effect)}
    inside = [p for p in effect.parameters if p.fitted and p not in linear and p.name not in held]
    axes = _axes(effect, inside, scales)
    for values in itertools.product(*(axis.points for axis in axes)):
        coordinates = dict(zip((axis.name for axis in axes), map(float, values), strict=True))
        yield _own(effect, {**held, **coordinates})


def beside(
    effect: Effect, inner: Mapping[str, float], scales: Mapping[str, float], halvings: int
) -> Iterator[dict[str, float]]:
    """Yield the points on both sides of one along each coordinate, at a step of the grid that was halved so often."""
    left_out = {effect.post_yield_stiffness_ratio, *_exponents(effect)}
    inside = [p for p in effect.parameters if p.fitted and p.name in inner and p.name not in left_out]
    here = _coordinates(effect, inner)
    for axis in _axes(effect, inside, scales):
        if axis.points.size < 2:
            continue
        first, second = axis.points[:2]
        for way in (-(0.5**halvings), 0.5**halvings):
            before = here[axis.name]
            moved = before + way * (second - first) if axis.is_even else before * (second / first) ** way
            if axis.points[0] <= moved <= axis.points[-1]:
                yield _own(effect, {**here, axis.name: float(moved)})


@dataclass(frozen=True, eq=False)
class _Axis:
    """A coordinate of the grid and its points."""

    name: str  # of a parameter, or of the sum or difference of two
    points: Floats
    is_even: bool  # whether they are evenly spaced, and not their logarithms


def _sizes(pair: SumAndDifference) -> dict[str, tuple[float, float]]:
    return {
        f"{pair.first} + {pair.second}": pair.sum_range,
        f"{pair.first} - {pair.second}": pair.difference_range,
    }


def _exponents(effect: Effect) -> list[str]:
    """Return the powers in which sums and differences are searched; they keep their special values."""
    return [pair.exponent for pair in effect.searched_as if pair.exponent in effect.special_cases]


def _axes(effect: Effect, inside: Sequence[Parameter], scales: Mapping[str, float]) -> list[_Axis]:
    paired = {name for pair in effect.searched_as for name in (pair.first, pair.second)}
    single = [p for p in inside if p.name not in paired]
    n = POINTS.get(len(single), 2)
    found = []
    for pair in effect.searched_as:
        unit = usual(effect, next(p for p in effect.parameters if p.name == pair.first), scales)
        for name, (_, high) in _sizes(pair).items():
            low, share = _WITHIN
            found.append(_Axis(name, unit * np.geomspace(low, share * high, _OF_PAIRS), is_even=False))
    return found + [_Axis(p.name, _grid(effect, p, scales, n), _is_even(effect, p)) for p in single]


def _own(effect: Effect, coordinates: Mapping[str, float]) -> dict[str, float]:
    """Return parameters from coordinates."""
    own = dict(coordinates)
    for pair in effect.searched_as:
        power = 1.0 if pair.exponent is None else own[pair.exponent]
        total, difference = (own.pop(name) ** power for name in _sizes(pair))
        own[pair.first], own[pair.second] = (total + difference) / 2.0, (total - difference) / 2.0
    return own


def _coordinates(effect: Effect, own: Mapping[str, float]) -> dict[str, float]:
    """Return coordinates from parameters."""
    found = dict(own)
    for pair in effect.searched_as:
        power = 1.0 if pair.exponent is None else own[pair.exponent]
        first, second = found.pop(pair.first), found.pop(pair.second)
        for name, size in zip(_sizes(pair), (first + second, first - second), strict=True):
            found[name] = max(size, 0.0) ** (1.0 / power)
    return found


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
