"""Hysteresis parameters from records: global search by simulation, then output-error refinement."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.errors import InputError, check_option
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.first_states import first_state
from rigsight.identify.fit.fit_data import FitResult, free_names
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.identify.hysteresis.derived import DerivedQuantities, derived_quantities, record_amplitudes
from rigsight.identify.hysteresis.search import SearchBox, search
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
_SUBSTEPS = 2
_ROUGH_EVALUATIONS = 40
_ROUGH_TOLERANCE = 1e-3
_ROUGH_ACCURACY = 1e-3
_HOPS = 4
"""Number of fits started near the best one: with stiff loops the cost has many minima within a few percent of the truth."""
_HOP = 0.1
"""Relative size of such a step."""


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


def better(one: FitResult | None, other: FitResult) -> FitResult:
    """Return the fit with the lower cost."""
    return other if one is None or other.cost < one.cost else one


def calibrate_to_records(
    structure: Structure,
    records: Sequence[Record],
    constants: Mapping[str, float],
    rng: np.random.Generator,
    *,
    start: Mapping[str, float] | None = None,
    free: Sequence[str] | None = None,
    output_noise: Mapping[str, float] | None = None,
    spread: float = 10.0,
    n_generations: int = 100,
    n_sets: int = 96,
    n_ends: int = 8,
    n_jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Calibrate a structure with hysteresis to records, best at several amplitudes below and above saturation.

    Values written into the equations as numbers are kept. Start values of the rig that are missing are estimated from the
    spectra, and its parameters are searched within a factor `spread` around them; effects need none, because their whole
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
    noise = dict(
        output_noise
        or {
            name: 0.01 * (float(np.sqrt(np.mean([np.var(record[name]) for record in records]))) or 1.0)
            for name in outputs
        }
    )
    tell = progress or (lambda _: None)

    simple, simple_free = special_structure(structure, chosen)
    threads = IdleThreads(n_jobs)
    look = GreyBoxFit(simple, records, scales, noise, _ROUGH_ACCURACY, threads=threads)
    searched = tuple(name for name in simple_free if name not in _shifts(structure))
    coordinates = Coordinates.of(simple, searched, begin, scales)
    box = SearchBox.around(coordinates, coordinates.from_values(begin), spread)
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
    rough += map(refined, neighbors(simple, min(rough, key=lambda fit: fit.cost).values))
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
        settled = better(settled, careful.fit(values, rough.free, settled.initial_states))
    if simple is structure or not settled.residuals:
        return settled
    whole = GreyBoxFit(structure, records, scales, noise, threads=threads)
    special = {name: value for name, value in simple.fixed if name in free}
    values = {**settled.values, **dict(simple.fixed)}
    best = whole.fit(values, free, settled.initial_states)
    if best.cost < settled.cost / RELEASE_GAIN:
        beyond = {**values, **{name: BEYOND * value for name, value in special.items()}}
        best = better(best, whole.fit(beyond, free, settled.initial_states))
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


def _shifts(structure: Structure) -> set[str]:
    """Return parameters that affect only means, or outputs other than the first; the search does not need them."""
    return {p.name for p in structure.rig.parameters} - numbers_of_motion(structure.rig)


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
    found = []
    for effect, start in (
        (e, start) for e in structure.effects for start in e.starts if start.parent is None
    ):
        own = declared_values(structure.rig, effect, start.values, begin, scales)
        found.append({**begin, **own_sizes, **in_structure(structure, effect, own)})
    return found


def neighbors(structure: Structure, values: Mapping[str, float]) -> list[dict[str, float]]:
    """Return the start values that the effects declare for another fit: a fit may have ended in a nearby local minimum."""
    return [
        {**values, **moved}
        for effect in structure.effects
        for moved in moved_starts(structure, effect, values)
    ]
