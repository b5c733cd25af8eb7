"""Search coordinates: parameters in characteristic units, logarithms of positive ones, and well-determined combinations.

Such combinations are the sum and difference of a pair, the excess of one parameter over another that is never larger, and for a
hysteretic spring the post-yield stiffness and the secant stiffness of the remainder at the displacement of the records: of a
spring that yields far below it, records determine the force at which it yields, and hardly its initial stiffness.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect, Place, placed_dimension
from rigsight.parameters import Parameter
from rigsight.records.record import Floats
from rigsight.simulate import Structure, parameter_vector
from rigsight.units import characteristic_value

STEP = 1e-4
"""Difference step of a coordinate if there may be events: far above the tolerance of their location, far below any curvature."""
FINE_STEP = 1e-6
"""Difference step of a coordinate without events: sets side by side take the same steps, so that only rounding limits it."""
_MARGIN = 1e-9
_BESIDE_FREE_GAIN = 25.0
"""Factor on the largest limit of a drive whose signal has a free gain (an assumption): a fit without the limit takes what it cuts
off for a small gain, which grows beside it. Beyond the signal itself a limit of a known gain would not act."""
_LEAST_STIFFNESS = 1e-12
_MOST_STIFFNESS = 1e12
"""Range of a stiffness with memory, in characteristic units: its logarithm is searched."""


@dataclass(frozen=True)
class _Pair:
    """Two coordinates for sum and difference, to the power 1/n if an exponent is named."""

    first: int
    second: int
    exponent: str | None

    def forward(self, theta: float, power: float) -> float:
        """Return the sum or difference, in characteristic units, of a coordinate."""
        return float(np.copysign(np.abs(theta) ** power, theta))


@dataclass(frozen=True)
class _Split:
    """Coordinates for the logarithm of the secant stiffness with memory, and for the stiffness without memory."""

    stiffness: int
    share: int
    own: NDArray[np.intp]  # parameters on which the secant depends, among all
    yielded: Callable[
        ..., Sequence[float]
    ]  # of these: displacement over yield deflection, and its derivatives

    def softening(self, p: Floats) -> tuple[float, Floats]:
        """Return the secant stiffness as a share of the initial one, and the derivatives of its logarithm by all parameters."""
        slopes = np.zeros(p.size)
        with np.errstate(all="ignore"):
            yielded, *derivatives = self.yielded(*p[self.own])
        # Parameters without a yield deflection are those of a spring that does not yield.
        if not (np.isfinite(yielded) and yielded > 0.0 and np.all(np.isfinite(derivatives))):
            return 1.0, slopes
        slopes[self.own] = -np.array(derivatives) / (1.0 + yielded)
        return 1.0 / (1.0 + yielded), slopes


@dataclass(frozen=True)
class Coordinates:
    """Maps a vector of search coordinates to the parameters of a structure and back."""

    structure: Structure
    free: tuple[str, ...]  # parameters that are fitted
    base: Floats
    index: NDArray[np.intp]
    scale: Floats
    logarithmic: NDArray[np.bool_]
    pairs: tuple[_Pair, ...]
    excesses: tuple[tuple[int, int], ...]
    split: _Split | None
    lower: Floats  # bounds of the coordinates, shape (n_free,)
    upper: Floats

    @classmethod
    def of(
        cls,
        structure: Structure,
        free: Sequence[str],
        values: Mapping[str, float],
        scales: Mapping[str, float],
    ) -> Coordinates:
        """Build the coordinates of the free parameters; the others stay at `values`."""
        parameters = {p.name: p for p in structure.parameters}
        chosen = [parameters[name] for name in free]
        scale = np.array([characteristic_value(p.dimension, scales) for p in chosen])
        logarithmic = np.array([p.logarithmic for p in chosen], dtype=bool)
        # From negative stiffness, with which a simulation diverges, a search seldom returns: the start has the right sign.
        returning = [name in structure.rig.usually_positive and values[name] > 0.0 for name in free]
        bounds = [_bounds(*own) for own in zip(chosen, scale, returning, strict=True)]
        lower, upper = np.array(bounds, dtype=np.float64).reshape(-1, 2).T.copy()
        beside_gain = [free.index(name) for name in _limits_beside_gain(structure, free)]
        upper[beside_gain] *= _BESIDE_FREE_GAIN
        pairs = []
        searched = [(effect, pair) for effect in structure.effects for pair in effect.searched_as]
        for effect, pair in searched:
            names = [structure.parameter_name(effect, own) for own in (pair.first, pair.second)]
            if set(names) <= set(free):
                first, second = map(free.index, names)
                lower[first], upper[first] = pair.sum_range
                lower[second], upper[second] = pair.difference_range
                exponent = None if pair.exponent is None else structure.parameter_name(effect, pair.exponent)
                pairs.append(_Pair(first, second, exponent))
        excesses = []
        for effect in structure.effects:
            for larger, smaller in effect.ordered:
                names = [structure.parameter_name(effect, own) for own in (larger, smaller)]
                if names[0] in free:
                    lower[free.index(names[0])] = 0.0
                    excesses.append((free.index(names[0]), structure.names.index(names[1])))
        split = _split(structure, free, scales)
        if split is not None:
            stiffness = chosen[split.stiffness]
            most = min(stiffness.upper / scale[split.stiffness], _MOST_STIFFNESS)
            lower[split.stiffness], upper[split.stiffness] = np.log(_LEAST_STIFFNESS), np.log(most)
            lower[split.share], upper[split.share] = 0.0, most
        return cls(
            structure=structure,
            free=tuple(free),
            base=parameter_vector(structure, values),
            index=np.array([structure.names.index(name) for name in free], dtype=np.intp),
            scale=scale,
            logarithmic=logarithmic,
            pairs=tuple(pairs),
            excesses=tuple(excesses),
            split=split,
            lower=lower,
            upper=upper,
        )

    def to_parameters(self, theta: Floats) -> Floats:
        """Return the full parameter vector, shape (n_parameters,), for coordinates of shape (n_free,)."""
        own = np.where(self.logarithmic, np.exp(np.where(self.logarithmic, theta, 0.0)), theta) * self.scale
        p = self.base.copy()
        p[self.index] = own
        for pair in self.pairs:
            power = self._power(pair, p)
            size = self.scale[pair.first] ** power
            total = pair.forward(theta[pair.first], power) * size
            difference = pair.forward(theta[pair.second], power) * size
            p[self.index[pair.first]] = (total + difference) / 2.0
            p[self.index[pair.second]] = (total - difference) / 2.0
        for larger, smaller in self.excesses:
            p[self.index[larger]] += p[smaller]
        if self.split is not None:
            stiffness, share = self.split.stiffness, self.split.share
            whole = np.exp(theta[stiffness]) / self.split.softening(p)[0] + theta[share]
            p[self.index[stiffness]] = whole * self.scale[stiffness]
            p[self.index[share]] = theta[share] / whole
        return p

    def from_values(self, values: Mapping[str, float]) -> Floats:
        """Return the coordinates of parameter values, moved inside the bounds, shape (n_free,)."""
        plain = np.array([values[name] for name in self.free])
        own = plain / self.scale
        positive = np.where(self.logarithmic, np.maximum(own, 1e-300), 1.0)
        theta = np.where(self.logarithmic, np.log(positive), own)
        p = self.base.copy()
        p[self.index] = plain
        for pair in self.pairs:
            power = self._power(pair, p)
            size = self.scale[pair.first] ** power
            first, second = plain[pair.first], plain[pair.second]
            theta[pair.first] = pair.forward((first + second) / size, 1.0 / power)
            theta[pair.second] = pair.forward((first - second) / size, 1.0 / power)
        for larger, smaller in self.excesses:
            theta[larger] = (plain[larger] - p[smaller]) / self.scale[larger]
        if self.split is not None:
            whole, elastic = own[self.split.stiffness], plain[self.split.share]
            secant = self.split.softening(p)[0] * (1.0 - elastic) * whole
            theta[self.split.stiffness] = np.log(max(secant, _LEAST_STIFFNESS))
            theta[self.split.share] = elastic * whole
        width = np.minimum(self.upper - self.lower, 1e6)
        return np.clip(theta, self.lower + _MARGIN * width, self.upper - _MARGIN * width)

    def _power(self, pair: _Pair, p: Floats) -> float:
        if pair.exponent is None:
            return 1.0
        fixed = dict(self.structure.fixed)
        if pair.exponent in fixed:
            return fixed[pair.exponent]
        return float(p[self.structure.names.index(pair.exponent)])

    def derivatives(self, theta: Floats) -> Floats:
        """Return d parameters / d coordinates of all parameters, shape (n_parameters, n_free)."""
        p = self.to_parameters(theta)
        own = np.where(self.logarithmic, p[self.index], self.scale)
        slopes = np.zeros((p.size, len(self.free)))
        slopes[self.index, np.arange(len(self.free))] = own
        for pair in self.pairs:
            power = self._power(pair, p)
            size = self.scale[pair.first] ** power
            rows = []
            for place in (pair.first, pair.second):
                row = np.zeros(len(self.free))
                if pair.exponent in self.free:
                    # A power of zero is zero for any exponent.
                    base = max(float(np.abs(theta[place]) * self.scale[pair.first]), 1e-300)
                    growth = pair.forward(theta[place], power) * size * np.log(base)
                    row[self.free.index(pair.exponent)] = growth * own[self.free.index(pair.exponent)]
                row[place] += power * np.abs(theta[place]) ** (power - 1.0) * size
                rows.append(row)
            total, difference = rows
            slopes[self.index[pair.first]] = (total + difference) / 2.0
            slopes[self.index[pair.second]] = (total - difference) / 2.0
        for larger, smaller in self.excesses:
            slopes[self.index[larger]] += slopes[smaller]
        if self.split is not None:
            stiffness, share = self.split.stiffness, self.split.share
            softening, by_parameters = self.split.softening(p)
            with_memory, without = np.exp(theta[stiffness]) / softening, theta[share]
            whole = with_memory + without
            growth, own = -with_memory * (by_parameters @ slopes), np.zeros((2, len(self.free)))
            growth[stiffness] += with_memory
            own[0], own[1, share] = growth, 1.0
            slopes[self.index[stiffness]] = self.scale[stiffness] * own.sum(axis=0)
            slopes[self.index[share]] = (with_memory * own[1] - without * own[0]) / whole**2
        return slopes

    def jacobian(self, theta: Floats) -> Floats:
        """Return d parameters / d coordinates of the free parameters, shape (n_free, n_free)."""
        return self.derivatives(theta)[self.index]


def _limits_beside_gain(structure: Structure, free: Sequence[str]) -> list[str]:
    """Return the free limits of drives whose signal has a free parameter."""
    signals = {drive.name: drive.signal.free_symbols for drive in structure.rig.mechanism.drives}
    return [
        name
        for effect in structure.effects
        if effect.place is Place.ACTUATOR
        for p in effect.parameters
        if p.is_limit and (name := structure.parameter_name(effect, p.name)) in free
        if any(symbol.name in free for symbol in signals.get(structure.rig.acts_at(effect), ()))
    ]


def _split(structure: Structure, free: Sequence[str], scales: Mapping[str, float]) -> _Split | None:
    """Return the indices of a spring's stiffness and post-yield ratio, if both are fitted; for the first of several effects."""
    # The spring is that of the joint at which the effect acts; its stiffness must be a single parameter.
    rig = structure.rig
    stiffness_at = {joint.name: joint.stiffness for joint in rig.mechanism.joints}
    for effect in structure.effects:
        if effect.post_yield_stiffness_ratio is not None:
            share = structure.parameter_name(effect, effect.post_yield_stiffness_ratio)
            stiffness = stiffness_at[rig.acts_at(effect)]
            if stiffness.is_Symbol and stiffness.name in free and share in free:
                x = characteristic_value(placed_dimension(effect, "x"), scales)
                return _Split(free.index(stiffness.name), free.index(share), *_yielded(structure, effect, x))
    return None


def _yielded(
    structure: Structure, effect: Effect, x: float
) -> tuple[NDArray[np.intp], Callable[..., Sequence[float]]]:
    """Return the parameters of a yield deflection, and of these a displacement over it and the derivatives of that."""
    over = effect.mean_yield if effect.mean_yield is not None else effect.yields_over
    held = dict(structure.fixed)
    names = {p.name: structure.parameter_name(effect, p.name) for p in effect.parameters}
    yielded = sp.Integer(0) if over is None else x / over
    yielded = yielded.subs({s: held[name] for s in yielded.free_symbols if (name := names[s.name]) in held})
    own = sorted(yielded.free_symbols, key=str)
    places = [structure.names.index(names[symbol.name]) for symbol in own]
    return np.array(places, dtype=np.intp), sp.lambdify(own, [yielded, *(yielded.diff(s) for s in own)])


def _bounds(parameter: Parameter, scale: float, is_returning: bool) -> tuple[float, float]:
    low = max(parameter.lower / scale, parameter.search[0])
    high = min(parameter.upper / scale, parameter.search[1])
    if parameter.logarithmic:
        return float(np.log(max(low, 1e-12))), float(np.log(min(high, 1e12)))
    return max(low, 0.0) if is_returning else low, high
