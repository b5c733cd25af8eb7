"""Parameter values of a hidden effect, so that it causes a gap of the requested size.

The shape (which effect, which proportions) is drawn from ranges wider than the declared starts, so that a search does not begin
at the truth; the strength is then scaled until the error of the linear equations, re-identified on two sweeps, is the requested
multiple of the noise floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rigsight.effects import Effect, placed_dimension
from rigsight.errors import SimulationError
from rigsight.parameters import Parameter
from rigsight.units import characteristic_value

GAPS = (5.0, 100.0)
"""Gap of the re-identified equations in noise floors: from just visible in a plot to a wrong model."""
_MOST_OF_MOTION = 0.5
"""Gap in units of the reading's size that is not exceeded: whoever measures knows the rig better than that."""
_STRONGEST = 1.5
"""Most that a strength may exceed the strongest start value of the effect's declaration."""
_BEYOND_STARTS = 2.0
"""Factor by which the range of an inner number (a delay's, a knee's, a wave's) exceeds the declared starts on either side.

Starts of one number are two to five times apart, so that the truth is up to twice off the next start.
"""
_LIMITS = {"drive": 0.2, "input": 0.2}
"""Friction and dead zones beyond this share of the largest drive would stop the rig on its smallest sweep."""
_NEVER = 1e300
"""A null value that stands for an unreachable threshold."""
_TRIALS = 7
_CLOSE = 0.15
_SMALLEST = 1e-5
_LEAST_OF_WISHED = 0.5
"""Share of the requested gap that an effect must cause; one that cannot at its place is drawn again."""


def draw_shape(effect: Effect, scales: Mapping[str, float], rng: np.random.Generator) -> dict[str, float]:
    """Return a value for each of the effect's parameters by its own name, at full strength."""
    shape: dict[str, float] = {}
    for p in effect.parameters:
        spread = math.exp(rng.uniform(-0.4, 0.4))
        if p.null is None and p.starts and p.fitted:
            shape[p.name] = _inner(p, rng) * _unit(effect, p.dimension, scales)
        elif p.starts and p.fitted:
            start = p.starts[int(rng.integers(len(p.starts)))]
            shape[p.name] = start * _unit(effect, p.dimension, scales) * spread
        else:
            shape[p.name] = p.held_at(_unit(effect, p.dimension, scales))
        shape[p.name] = min(max(shape[p.name], p.lower), p.upper)
        if p.null == 1.0:
            shape[p.name] = rng.uniform(0.1, 0.5)
        if p.name in effect.special_cases:
            shape[p.name] = effect.special_cases[p.name] * (
                1.0 if rng.random() < 0.5 else rng.uniform(1.2, 2.5)
            )
    for pair in effect.searched_as:
        dimension = next(p.dimension for p in effect.parameters if p.name == pair.first)
        unit = _unit(effect, dimension, scales)
        total = unit * math.exp(rng.uniform(math.log(1.5), math.log(12.0)))
        difference = unit * math.exp(rng.uniform(math.log(1.5), math.log(20.0)))
        shape[pair.first], shape[pair.second] = 0.5 * (total + difference), 0.5 * (total - difference)
    if {"T_c", "T_s"} <= shape.keys():
        # Friction that grows with speed would not be Stribeck friction.
        shape["T_s"] = shape["T_c"] * rng.uniform(1.25, 2.0)
    return shape


def _inner(parameter: Parameter, rng: np.random.Generator) -> float:
    """Return an inner number in units of its dimension: evenly over its logarithm, or over itself where its sign is open.

    It lies within the range that a search explores: a power law with an exponent of 1 would be a linear spring.
    """
    low, high = min(parameter.starts), max(parameter.starts)
    if low > 0.0:
        least, most = parameter.search
        low, high = max(low / _BEYOND_STARTS, least), min(high * _BEYOND_STARTS, most)
        return math.exp(rng.uniform(math.log(low), math.log(high)))
    half = 0.5 * (high - low)
    return float(rng.uniform(low - half, high + half))


def scaled(
    effect: Effect,
    shape: Mapping[str, float],
    strength: float,
    scales: Mapping[str, float],
    limits: Mapping[str, float] = _LIMITS,
) -> dict[str, float]:
    """Return the parameters of an effect between its null (strength 0) and its full shape (1), or beyond.

    Parameters
    ----------
    effect, shape, strength
        The effect, its parameters at full strength, and how strong it is.
    scales
        Size of each base quantity.
    limits
        Largest value of a growing parameter by its dimension, in units of the size of that.
    """
    values = dict(shape)
    growing = [p for p in effect.parameters if p.null is not None and p.null < _NEVER and p.null != 1.0]
    # What grows stops together: static friction held at the limit of its sliding part would be Coulomb friction.
    most = [
        limits[p.dimension] * _unit(effect, p.dimension, scales) / abs(shape[p.name])
        for p in growing
        if p.dimension in limits and shape[p.name]
    ]
    growth = min([strength, *most])
    for p in effect.parameters:
        if p.null is None:
            continue
        if p.null >= _NEVER:
            values[p.name] = shape[p.name] / strength
        elif p.null == 1.0:
            values[p.name] = max(1.0 - strength * (1.0 - shape[p.name]), 0.02)
        else:
            values[p.name] = growth * shape[p.name]
    return values


def _unit(effect: Effect, dimension: str, scales: Mapping[str, float]) -> float:
    """Return the size of a quantity of an effect, at its place if it has one."""
    return characteristic_value(placed_dimension(effect, dimension), scales)


def strength_for(gap: Callable[[float], float], wished: float, strongest: float = _STRONGEST) -> float:
    """Return the strength at which a gap is close to the requested size, or the largest allowed strength.

    Parameters
    ----------
    gap
        Gap over strength, rising; raises `SimulationError` where the plant cannot be simulated.
    wished
        The gap to reach.
    strongest
        Largest strength.
    """
    low, high = _SMALLEST, strongest
    strength, best = 0.3, (math.inf, _SMALLEST)
    for _ in range(_TRIALS):
        try:
            reached = gap(strength)
        except SimulationError:
            reached = math.inf
        distance = abs(math.log(max(reached, 1e-12) / wished)) if math.isfinite(reached) else math.inf
        best = min(best, (distance, strength))
        if distance < _CLOSE or (strength >= strongest and reached < wished):
            break
        if reached > wished:
            high = min(high, strength)
        else:
            low = max(low, strength)
        # Usually the gap is proportional to the strength; a threshold needs bisection.
        step = strength * wished / reached if 0.0 < reached < math.inf else 0.5 * strength
        inside = low < step < high
        strength = (
            step if inside else (high if high == strongest and reached < wished else math.sqrt(low * high))
        )
    return best[1]


def draw_gap(sizes: Mapping[str, float], floor: Mapping[str, float], rng: np.random.Generator) -> float:
    """Draw the gap of an effect in units of the floor.

    Parameters
    ----------
    sizes
        Of each reading.
    floor
        What is left of each without effects.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If the floor is too large for a visible gap.
    """
    most = min(GAPS[1], max(_MOST_OF_MOTION * sizes[name] / own for name, own in floor.items()))
    if most <= GAPS[0]:
        raise SimulationError("Noise and disturbance are too large for a visible gap.")
    return math.exp(rng.uniform(math.log(GAPS[0]), math.log(most)))


@dataclass(frozen=True)
class Sized:
    """An effect of a requested size: its strength, the gap that it causes alone, and its parameters by their own names."""

    strength: float
    gap: float
    values: dict[str, float]


def sized(
    name: str,
    values_at: Callable[[float], dict[str, float]],
    gap_of: Callable[[dict[str, float]], float],
    wished: float,
    least: float | None = None,
    strongest: float = _STRONGEST,
) -> Sized:
    """Return an effect with the strength at which it causes a gap close to the requested size.

    Parameters
    ----------
    name
        Of the effect.
    values_at
        Its parameters over its strength, as `scaled` returns them.
    gap_of
        Gap, in units of the noise, over the parameters of the effect.
    wished
        Gap to reach together with the noise, in units of the noise.
    least
        Smallest accepted gap; default is half of the requested one.
    strongest
        Largest strength.

    Raises
    ------
    SimulationError
        If the effect cannot cause that.
    """
    reached: dict[float, float] = {}

    def gap(strength: float) -> float:
        reached[strength] = gap_of(values_at(strength))
        return reached[strength]

    strength = strength_for(gap, math.sqrt(wished**2 - 1.0), strongest)
    most = reached.get(strength, 0.0)
    if most < (_LEAST_OF_WISHED * wished if least is None else least):
        raise SimulationError(f"{name} causes a gap of at most {most:.2g} noise floors.")
    return Sized(strength, most, values_at(strength))
