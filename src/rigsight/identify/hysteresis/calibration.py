"""Hysteresis parameters from records: global search by simulation, then output-error refinement.

The search is differential evolution over the whole range of the parameters, with all sets side by side.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import Bounds, differential_evolution
from scipy.stats import qmc

from rigsight.errors import InputError, check_option
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.first_states import first_state
from rigsight.identify.fit.fit_data import FitResult, free_names
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.identify.hysteresis.derived import DerivedQuantities, derived_quantities, record_amplitudes
from rigsight.identify.start.declared_starts import declared_values, in_structure, moved_starts
from rigsight.identify.start.linear_start import linear_start
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose, simulate_sets
from rigsight.units import characteristic_value

RELEASE_GAIN = 1.01
"""Factor by which releasing a special value (an exponent of 1) must lower the cost for other starts to be tried."""
BEYOND = 2.0
"""Factor of the special value that gives the other start."""
_SPREAD = 10.0
"""Factor around their start values within which the parameters of the rig are searched."""
_SUBSTEPS = 2
_ROUGH_EVALUATIONS = 40
_ROUGH_TOLERANCE = 1e-3
_ROUGH_ACCURACY = 1e-3
_HOPS = 4
"""Number of fits started near the best one: with stiff loops the cost has many minima within a few percent of the truth."""
_HOP = 0.1
"""Relative size of such a step."""
_APART = 0.1
"""Distance in the unit cube above which two ends of a search count as different."""
_EVENLY = 0.1
"""Characteristic units up to which a range is spaced evenly."""
_UNUSABLE = 1e100
"""Cost of a set that cannot be simulated; its square is still finite."""
Cost = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Minimum:
    """One local minimum, at which the refinement of a search ended."""

    values: dict[str, float]  # of every parameter
    cost: float  # mean squared weighted residual


@dataclass(frozen=True, eq=False)
class Calibration:
    """Hysteresis parameters, with quantities derived from them."""

    fit: FitResult  # values, covariance and residuals
    derived: DerivedQuantities  # saturation, pair and loop areas, with intervals
    # Local minima reached from the ends of the search and from the effects' own starts, best first, before special values were
    # released. Several of similar cost show that the data allow several sets.
    minima: tuple[Minimum, ...]

    @property
    def values(self) -> dict[str, float]:
        """Every parameter by name."""
        return self.fit.values

    @property
    def standard_errors(self) -> dict[str, float]:
        """Of the fitted parameters by name."""
        return self.fit.standard_errors


def calibrate_to_records(
    structure: Structure,
    records: Sequence[Record],
    constants: Mapping[str, float],
    rng: np.random.Generator,
    *,
    start: Mapping[str, float] | None = None,
    free: Sequence[str] | None = None,
    output_noise: Mapping[str, float] | None = None,
    n_generations: int = 100,
    n_sets: int = 96,
    n_ends: int = 8,
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Calibrate a structure with hysteresis to records, best at several amplitudes below and above saturation.

    Values written into the equations as numbers are kept. Start values of the rig that are missing are estimated from the
    spectra, and its parameters are searched within a factor of 10 around them; effects need none, because their whole
    declared range is searched. By default all parameters that the records can determine are free, and residuals are divided
    by 1 % of the size of an output; if one output is fitted, standard errors do not depend on it, because they follow from
    the residuals. The result does not depend on `n_jobs`, the number of records simulated at the same time.

    With stiff loops the cost has many local minima, and a search can end in a wrong basin: on simulated records of one stiff
    set, 60 generations of 64 sets did so in one of eight draws, the default in none of fifteen draws of four sets. Compare
    the residuals with the noise before relying on the parameters.
    """
    if not records:
        raise InputError("A calibration needs at least one record, got none.")
    rig = structure.rig
    outputs = [s.name for s in rig.outputs if all(s.name in record for record in records)]
    begin = {**constants, **linear_start(rig, records, constants, dict(start or {})), **dict(start or {})}
    begin = start_values(structure, begin)
    chosen = checked_free(structure, free_parameters(structure, outputs) if free is None else free)
    scales = characteristic_scales(rig, records, begin)
    usual = {
        name: 0.01 * (float(np.sqrt(np.mean([np.var(record[name]) for record in records]))) or 1.0)
        for name in outputs
    }
    noise = dict(output_noise or usual)
    tell = progress or (lambda _: None)

    simple, simple_free = special_structure(structure, chosen)
    threads = IdleThreads(n_jobs)
    look = GreyBoxFit(simple, records, scales, noise, _ROUGH_ACCURACY, threads=threads)
    # What affects only means, or outputs other than the first, is left to the refinement.
    shifts = {p.name for p in rig.parameters} - numbers_of_motion(rig)
    searched = tuple(name for name in simple_free if name not in shifts)
    coordinates = Coordinates.of(simple, searched, begin, scales)
    box = SearchBox.around(coordinates, coordinates.from_values(begin))
    ends = search(
        lambda thetas: _costs(look, coordinates, thetas),
        box,
        rng,
        n_generations=n_generations,
        n_sets=n_sets,
        n_ends=n_ends,
        progress=lambda generation: tell(f"generation {generation}"),
    )

    def refined(values: Mapping[str, float]) -> FitResult:
        return look.fit(
            values, simple_free, max_evaluations=_ROUGH_EVALUATIONS, tolerance=_ROUGH_TOLERANCE, finish=False
        )

    rough = []
    for theta in ends:
        values = dict(zip(simple.names, map(float, coordinates.to_parameters(theta)), strict=True))
        rough.append(refined(values))
        tell("refined an end of the search")
    rough += map(refined, declared_starts(simple, {n: begin[n] for n in simple.names}, scales))
    tell("refined the starts of the effects")
    # A fit may have ended in a nearby local minimum.
    near = min(rough, key=lambda fit: fit.cost).values
    neighbors = [
        {**near, **moved} for effect in simple.effects for moved in moved_starts(simple, effect, near)
    ]
    rough += map(refined, neighbors)
    tell("refined the neighbors of the best")
    rough.sort(key=lambda fit: fit.cost)
    fit = _refined(structure, chosen, simple, records, scales, noise, rough[0], rng, threads)
    tell("refined the best")
    minima = tuple(Minimum(f.all_values, f.cost / f.n_samples) for f in rough)
    amplitudes = record_amplitudes(structure, records, fit.values)
    derived = derived_quantities(fit, amplitudes, scales, rng)
    return Calibration(fit, derived, minima)


def _refined(
    structure: Structure,
    free: Sequence[str],
    simple: Structure,
    records: Sequence[Record],
    scales: Mapping[str, float],
    noise: Mapping[str, float],
    rough: FitResult,
    rng: np.random.Generator,
    threads: IdleThreads,
) -> FitResult:
    """Fit to full precision: with the special values, then with these released, then from another start if that helped."""
    careful = GreyBoxFit(simple, records, scales, noise, threads=threads)
    settled = careful.fit(rough.values, rough.free, rough.initial_states)
    coordinates = Coordinates.of(simple, rough.free, rough.values, scales)
    for _ in range(_HOPS):
        theta = coordinates.from_values(settled.values)
        moved = theta + _HOP * np.maximum(np.abs(theta), _HOP) * rng.standard_normal(theta.size)
        inside = np.clip(moved, coordinates.lower, coordinates.upper)
        values = dict(zip(simple.names, map(float, coordinates.to_parameters(inside)), strict=True))
        moved_fit = careful.fit(values, rough.free, settled.initial_states)
        settled = min(settled, moved_fit, key=lambda fit: fit.cost)
    if simple is structure or not settled.residuals:
        return settled
    whole = GreyBoxFit(structure, records, scales, noise, threads=threads)
    special = {name: value for name, value in simple.fixed if name in free}
    values = {**settled.values, **dict(simple.fixed)}
    best = whole.fit(values, free, settled.initial_states)
    if best.cost < settled.cost / RELEASE_GAIN:
        beyond = {**values, **{name: BEYOND * value for name, value in special.items()}}
        best = min(best, whole.fit(beyond, free, settled.initial_states), key=lambda fit: fit.cost)
    return best


def _costs(look: GreyBoxFit, coordinates: Coordinates, thetas: Floats) -> Floats:
    """Return the mean squared weighted residual of every set, shape (n_sets,)."""
    p = np.array([coordinates.to_parameters(theta) for theta in thetas]).T

    def of_record(number: int) -> Floats:
        data = look.data.records[number]
        first = first_state(look.structure, data.record, {})
        states = np.repeat(first[:, None], thetas.shape[0], axis=1)
        outputs = simulate_sets(
            look.structure, data.held, data.parameters(p), states, data.record.n_samples, _SUBSTEPS
        )
        with np.errstate(invalid="ignore", over="ignore"):
            # Offsets are left to the refinement.
            residual = (outputs[:, 0] - data.measured[:, :1]) * data.weights[0]
            return np.asarray(np.sum((residual - np.mean(residual, axis=0)) ** 2, axis=0))

    return np.asarray(np.sum(look.data.of_each_record(of_record), axis=0) / look.n_samples)


def numbers_of_motion(rig: Rig) -> set[str]:
    """Return the parameters and constants in stiffness, damping and inertia of a rig with one motion."""
    parts = (rig.motion.stiffness, rig.motion.damping, rig.motion.inertia)
    return {symbol.name for part in parts if part is not None for symbol in part.free_symbols}


def free_parameters(structure: Structure, outputs: Collection[str]) -> tuple[str, ...]:
    """Return the parameters that records of these outputs determine, without constants and those of unmeasured outputs."""
    rig = structure.rig
    motion = rig.motion
    moved = numbers_of_motion(rig)
    rest = {symbol.name for symbol in motion.rest.free_symbols}
    bias = {symbol.name for symbol in motion.bias.free_symbols}
    # With a spring a constant force is equivalent to a shifted rest position; a bench has no rest position.
    moved |= rest or bias
    for state, rate in rig.downstream.items():
        if state.name in outputs:
            moved |= {symbol.name for symbol in rate.free_symbols}
    of_rig = {p.name for p in rig.parameters}
    return tuple(free_names(structure, moved & of_rig))


def checked_free(structure: Structure, free: Sequence[str]) -> tuple[str, ...]:
    """Return the names in the order of the structure."""
    for name in free:
        check_option("A parameter to calibrate", name, structure.names)
    if not free:
        raise InputError("A calibration needs at least one free parameter, got none.")
    return tuple(name for name in structure.names if name in free)


def special_structure(structure: Structure, free: Sequence[str]) -> tuple[Structure, tuple[str, ...]]:
    """Write the special values of the effects (an exponent of 1) into the equations, which makes simulations ten times faster."""
    special = {
        structure.parameter_name(effect, name): value
        for effect in structure.effects
        for name, value in effect.special_cases.items()
        if structure.parameter_name(effect, name) in free
    }
    if not special:
        return structure, tuple(free)
    simpler = compose(structure.rig, structure.effects, {**dict(structure.fixed), **special})
    return simpler, tuple(name for name in free if name not in special)


def start_values(structure: Structure, start: Mapping[str, float]) -> dict[str, float]:
    """Return a value for every parameter: the given one, else the first start value of its effect, else the default."""
    # Values of effects are placeholders if a search over the whole range follows.
    of_rig = {p.name for p in (*structure.rig.constants, *structure.rig.parameters)}
    values = {p.name: p.default for p in structure.parameters if p.default is not None}
    values |= {p.name: p.starts[0] for p in structure.parameters if p.name not in of_rig and p.starts}
    values |= {name: value for name, value in start.items() if name in structure.names}
    missing = [name for name in structure.names if name not in values]
    if missing:
        raise InputError(f"Start values are missing for: {', '.join(missing)}.")
    return values


def declared_starts(
    structure: Structure, begin: Mapping[str, float], scales: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the start values that the effects declare, one effect at a time, for starts that depend on the rig alone."""
    own_sizes = {
        structure.parameter_name(effect, p.name): p.starts[0] * characteristic_value(p.dimension, scales)
        for effect in structure.effects
        for p in effect.parameters
        if p.fitted and p.starts and p.default is None
    }
    rig, own_starts = (
        structure.rig,
        [(e, s.values) for e in structure.effects for s in e.starts if s.parent is None],
    )
    declared = [(effect, declared_values(rig, effect, own, begin, scales)) for effect, own in own_starts]
    return [{**begin, **own_sizes, **in_structure(structure, *own)} for own in declared]


@dataclass(frozen=True, eq=False)
class SearchBox:
    """Maps the unit cube to search coordinates: evenly up to a tenth of a characteristic unit, by decades beyond (arsinh)."""

    # Range of each coordinate, shape (n_free,).
    lower: Floats
    upper: Floats

    @classmethod
    def around(cls, coordinates: Coordinates, center: Floats) -> SearchBox:
        """Take the declared range of a parameter if it has one, else a range around `center`."""
        structure = coordinates.structure
        of_rig = {p.name for p in structure.rig.parameters}
        lower, upper = coordinates.lower.copy(), coordinates.upper.copy()
        for i, name in enumerate(coordinates.free):
            if name not in of_rig:
                continue
            reach = np.log(_SPREAD) if coordinates.logarithmic[i] else _SPREAD * max(1.0, abs(center[i]))
            lower[i], upper[i] = max(lower[i], center[i] - reach), min(upper[i], center[i] + reach)
        split = coordinates.split
        if split is not None:
            # Both are parts of one stiffness, and only the total is known from the start.
            whole = np.exp(center[split.stiffness]) + center[split.share]
            lower[split.stiffness], upper[split.stiffness] = np.log(whole / _SPREAD), np.log(whole * _SPREAD)
            lower[split.share], upper[split.share] = 0.0, whole * _SPREAD
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
    evenly = np.asarray(qmc.Sobol(n_free, rng=rng).random_base2(int(np.ceil(np.log2(n_sets)))))
    # scipy's stubs do not know that a vectorized cost returns one value per column.
    vectorized: Any = of_places
    differential_evolution(
        vectorized,
        Bounds(np.zeros(n_free), np.ones(n_free)),
        strategy="currenttobest1bin",
        init=evenly[:n_sets],
        maxiter=n_generations,
        tol=1e-4,
        mutation=(0.4, 0.9),
        recombination=0.9,
        rng=rng,
        polish=False,
        updating="deferred",
        vectorized=True,
        callback=lambda *_: progress(next(generations)),
    )
    # The population ends in one basin, which may be wrong because the simulation is coarse; other basins were visited before.
    places, costs = np.concatenate(seen), np.concatenate(paid)
    kept = _different(places, costs, n_ends)
    usable = [place for place in kept if costs[place] < _UNUSABLE]
    if not usable:
        raise InputError("No parameter set in the search range can be simulated. Give better start values.")
    return box.coordinates(places[usable])


def _different(places: Floats, costs: Floats, most: int) -> list[int]:
    """Return the indices of the best points that differ from each other, best first."""
    kept: list[int] = []
    for i in np.argsort(costs):
        if all(np.max(np.abs(places[i] - places[j])) > _APART for j in kept):
            kept.append(int(i))
        if len(kept) == most:
            break
    return kept
