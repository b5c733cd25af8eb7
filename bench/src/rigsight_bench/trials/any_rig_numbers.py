"""Random parameters of a rig of any shape, such that its natural frequencies and damping are plausible.

All but offsets are drawn around one SI unit (or a declared default) and then adjusted together until the natural frequencies and
damping ratios of the linearization lie within bands and no two inertias are nearly indistinguishable.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rigsight.errors import SimulationError
from rigsight.identify import characteristic_scales
from rigsight.parameters import Parameter
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.linearization import linearize
from rigsight.units import characteristic_value, size_of

Floats = NDArray[np.float64]

FREQUENCIES = (3.0, 45.0)
"""Natural frequencies [rad/s]: several periods in a record of 20 s, and twenty samples of 5 ms in the shortest."""
DAMPING_RATIOS = (0.01, 0.3)
"""Damping ratios of oscillating poles: the decay lasts more than a period and less than a record."""
_RATES = (0.3, 200.0)
"""Sizes of poles that do not oscillate [1/s]: between the length of a record and its sample time."""
_INSIDE = 0.05
"""Share of a band, in logarithms, that the search stays away from its ends."""
_SPREAD = 0.6
"""Standard deviation of the logarithm of each number before it is moved."""
_DAMPERS = math.exp(-3.0)
"""Mean size of parameters that occur only in the damping of a joint: one SI unit would leave no vibration."""
_PULL = 0.05
"""Weight of the distance to the first draw relative to a factor e outside a band: it decides what the bands do not determine."""
_LEAST_APART = 0.1
"""Smallest eigenvalue of the mass matrix, each coordinate in units of its own inertia; zero is a singular one."""
_CONFIGURATIONS = 8
_OFFSET = 0.1
"""Standard deviation of an offset in units of the size of its kind in the records."""
_ZERO = 1e-6
"""Share of the largest pole below which a pole counts as zero: a motion without restoring force."""
_DRAWS = 20


def draw_numbers(rig: Rig, rng: np.random.Generator) -> dict[str, float]:
    """Return constants and parameters of a rig that is stable, or drifts at most; offsets are zero.

    Parameters
    ----------
    rig
        The rig.
    rng
        Source of randomness.

    Raises
    ------
    SimulationError
        If none of many draws has plausible natural frequencies and damping.
    """
    search = _Search(rig)
    for _ in range(_DRAWS):
        values = search.drawn(rng)
        if values is not None:
            return values
    raise SimulationError(f"No parameter values were found with which {rig.name} has plausible poles.")


def draw_offsets(
    rig: Rig, records: list[Record], values: Mapping[str, float], rng: np.random.Generator
) -> dict[str, float]:
    """Return the offsets of readings and rest positions, small compared with the motion in these records.

    Parameters
    ----------
    rig
        The rig.
    records
        With its inputs and, simulated, its outputs.
    values
        Its other numbers.
    rng
        Source of randomness.
    """
    offsets = [p for p in rig.parameters if is_offset(p)]
    if not offsets:
        return {}
    scales = characteristic_scales(rig, records, values)
    found = {}
    for p in offsets:
        dimension = p.dimension or size_of(p.name)
        # The size of an unknown offset follows from the sensors that read in its unit.
        own = dimension == size_of(p.name)
        size = _size_of_kind(rig, p, records) if own else characteristic_value(dimension, scales)
        found[p.name] = _OFFSET * size * rng.normal()
    return found


def is_offset(parameter: Parameter) -> bool:
    """Return True for a parameter whose default is zero."""
    return parameter.default == 0.0


def _size_of_kind(rig: Rig, parameter: Parameter, records: list[Record]) -> float:
    """Return the size of a reading in the unit of the parameter, 0 if no sensor reads in this unit."""
    alike = [s.name for s in rig.outputs if s.unit == parameter.unit]
    return max((float(np.std(r[name])) for r in records for name in alike), default=0.0)


@dataclass(frozen=True)
class _Bands:
    """Bands of natural frequencies, damping ratios, other rates and the smallest eigenvalue of the inertia."""

    frequencies: tuple[float, float]
    ratios: tuple[float, float]
    rates: tuple[float, float]
    apart: float


_BANDS = _Bands(FREQUENCIES, DAMPING_RATIOS, _RATES, _LEAST_APART)


def _inside(band: tuple[float, float]) -> tuple[float, float]:
    """Return a band that begins and ends inside another."""
    margin = (band[1] / band[0]) ** _INSIDE
    return band[0] * margin, band[1] / margin


class _Search:
    """The bands as residuals over the logarithms of a rig's numbers."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.structure = compose(rig)
        self.sought = [p for p in rig.parameters if not is_offset(p)]
        self._mass = _scaled_mass(rig)
        dampers = set().union(*(joint.damping.free_symbols for joint in rig.mechanism.joints))
        others = [part for j in rig.mechanism.joints for part in (j.stiffness, j.force)]
        others += [rig.mechanism.kinetic, rig.mechanism.potential, *(d.force for d in rig.mechanism.drives)]
        dampers -= set().union(*(part.free_symbols for part in others))
        self._dampers = {symbol.name for symbol in dampers}

    def drawn(self, rng: np.random.Generator) -> dict[str, float] | None:
        """Return numbers near a random draw with which the bands hold; None if there are none."""
        fixed = {c.name: self._constant(c, rng) for c in self.rig.constants}
        fixed |= {p.name: 0.0 for p in self.rig.parameters if is_offset(p)}
        first = np.array([math.log(self._middle(p)) + rng.normal(scale=_SPREAD) for p in self.sought])
        lower = np.array([math.log(p.lower) if p.lower > 0.0 else -np.inf for p in self.sought])
        upper = np.array([math.log(p.upper) if p.upper < math.inf else np.inf for p in self.sought])
        first = np.clip(first, lower + 1e-6, upper - 1e-6)
        shapes = rng.uniform(-1.0, 1.0, (_CONFIGURATIONS, len(self.rig.mechanism.free)))
        # Searched are bands inside those that must hold; their lower ends are drawn, or all rigs would end at the same.
        slow = FREQUENCIES[0] * (FREQUENCIES[1] / FREQUENCIES[0]) ** rng.uniform(_INSIDE, 0.5)
        light = DAMPING_RATIOS[0] * (DAMPING_RATIOS[1] / DAMPING_RATIOS[0]) ** rng.uniform(_INSIDE, 0.7)
        bands = _Bands(
            (slow, 0.9 * FREQUENCIES[1]),
            (light, 0.9 * DAMPING_RATIOS[1]),
            _inside(_RATES),
            2.0 * _LEAST_APART,
        )

        def values(theta: Floats) -> dict[str, float]:
            return {
                **fixed,
                **dict(zip((p.name for p in self.sought), map(float, np.exp(theta)), strict=True)),
            }

        def residuals(theta: Floats) -> Floats:
            return np.concatenate([_PULL * (theta - first), self._outside(values(theta), shapes, bands)])

        if not self.rig.mechanism.free or not self.sought:
            return values(first)
        try:
            found = least_squares(
                residuals, first, bounds=(lower, upper), max_nfev=40, diff_step=[1e-4] * first.size
            ).x
            missed = self._outside(values(found), shapes, _BANDS)
        except (SimulationError, ValueError):
            return None
        return values(found) if np.all(missed == 0.0) else None

    def _outside(self, values: Mapping[str, float], shapes: Floats, bands: _Bands) -> Floats:
        """Return by how much poles and inertias lie outside, shape (2 n_poles + n_configurations,)."""
        found = linearize(self.structure, values)
        poles = found.poles
        size = np.maximum(np.abs(poles), _ZERO * np.max(np.abs(poles)))
        kept = np.abs(poles) > _ZERO * np.max(np.abs(poles))
        vibrates = np.abs(poles.imag) > 0.0
        damping = -poles.real / size
        low = np.where(vibrates, bands.frequencies[0], bands.rates[0])
        high = np.where(vibrates, bands.frequencies[1], bands.rates[1])
        ratios = bands.ratios
        away = _beyond(np.log(size), np.log(low), np.log(high))
        # A negative damping ratio has no logarithm: below the band the distance is that to its lower end, over this.
        light = np.maximum(0.0, (ratios[0] - damping) / ratios[0])
        heavy = np.where(vibrates, np.maximum(0.0, np.log(np.maximum(damping, ratios[1]) / ratios[1])), 0.0)
        apart = np.array([float(np.linalg.eigvalsh(self._mass(values, q))[0]) for q in shapes])
        return np.concatenate(
            [
                np.where(kept, away, 0.0),
                np.where(kept, light + heavy, 0.0),
                np.maximum(0.0, bands.apart - apart),
            ]
        )

    def _middle(self, p: Parameter) -> float:
        if p.default:
            return p.default
        return _DAMPERS if p.name in self._dampers else 1.0

    def _constant(self, constant: Parameter, rng: np.random.Generator) -> float:
        if constant.default is not None:
            return constant.default
        return min(max(math.exp(rng.normal(scale=_SPREAD)), constant.lower), constant.upper)


def _beyond(value: Floats, low: Floats, high: Floats) -> Floats:
    return np.maximum(0.0, low - value) + np.maximum(0.0, value - high)


def _scaled_mass(rig: Rig) -> Callable[[Mapping[str, float], Floats], Floats]:
    """Return the mass matrix with ones on its diagonal as a function of numbers and coordinates."""
    matrix = rig.mechanism.mass_matrix
    free = [c.symbol for c in rig.mechanism.free]
    names = sorted(
        (s for s in matrix.free_symbols | {c.symbol for c in rig.mechanism.coordinates} if s not in free),
        key=lambda s: s.name,
    )
    function = sp.lambdify([names, free], matrix, modules="numpy")

    def at(values: Mapping[str, float], q: Floats) -> Floats:
        M = np.asarray(function([values.get(s.name, 0.0) for s in names], q), dtype=np.float64)
        d = np.sqrt(np.maximum(np.diag(M), 1e-300))
        return np.asarray(M / np.outer(d, d))

    return at
