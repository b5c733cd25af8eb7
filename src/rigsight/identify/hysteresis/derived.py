"""Quantities derived from hysteresis parameters: saturation, the pair that shapes the loop, and energy per cycle, with intervals.

Intervals come from draws of the parameters' covariance: saturation and pair are strongly nonlinear in the parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.errors import InputError
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.covariance import LEVEL, symmetric_eigen
from rigsight.identify.fit.fit_data import FitResult
from rigsight.records.record import Floats, Record
from rigsight.rigs import built_in
from rigsight.simulate import Structure, compose, simulate_sets
from rigsight.simulate.input_hold import hold_motion

_DRAWS = 400
_CYCLES = 4
_SAMPLES_PER_CYCLE = 512
_SUBSTEPS = 2


@dataclass(frozen=True)
class Derived:
    """A quantity derived from parameters, with its interval of confidence `LEVEL`; -inf to inf if they are undetermined."""

    name: str
    unit: str
    value: float  # at the fitted parameters; infinite if it has no bound
    lower: float
    upper: float


@dataclass(frozen=True)
class LoopArea:
    """Energy per cycle [force times displacement] at one amplitude of the spring's deflection."""

    amplitude: float
    energy: Derived


@dataclass(frozen=True)
class DerivedQuantities:
    """Quantities derived from hysteresis parameters."""

    pairs: tuple[
        Derived, ...
    ]  # sum and difference, in this order, of each pair that is searched in this form
    # Limit of the state of a spring with memory under increasing load, z_max = (A / (beta + gamma))^(1/n) for a Bouc-Wen spring;
    # None for effects without it.
    saturation: Derived | None
    saturation_in_words: str  # from the sign of the pair's sum (beta + gamma); empty without one
    loop_areas: tuple[LoopArea, ...]  # energy per cycle at each amplitude


def derived_quantities(
    fit: FitResult,
    amplitudes: Sequence[float],
    scales: Mapping[str, float],
    rng: np.random.Generator,
) -> DerivedQuantities:
    """Derive pairs, saturation, and loop areas at some deflections, as of `record_amplitudes`, from a fit with its covariance."""
    structure = fit.structure
    draws = parameter_draws(fit, scales, rng, _DRAWS)
    determined = _determined(fit)
    known = dict(structure.fixed)

    def of(name: str) -> Floats:
        if name in structure.names:
            return np.asarray(draws[structure.names.index(name)])
        return np.full(draws.shape[1], known[name])

    units = {p.name: p.unit for p in structure.parameters}
    pairs: list[Derived] = []
    saturation, words = None, ""
    for effect, pair in ((e, pair) for e in structure.effects for pair in e.searched_as):
        first, second = (structure.parameter_name(effect, name) for name in (pair.first, pair.second))
        unit = units.get(first, "")
        pairs.append(_derived(f"{first} + {second}", unit, of(first) + of(second), determined))
        pairs.append(_derived(f"{first} - {second}", unit, of(first) - of(second), determined))
        level = saturation_level(effect)
        if level is not None:
            own = {p.name: of(structure.parameter_name(effect, p.name)) for p in effect.parameters}
            reached = _saturation(level, own)
            saturation = _derived("z_max", structure.rig.units["x"], reached, determined)
            words = _in_words(saturation, f"{first} + {second}")
    hysteretic = any(effect.spring is not None for effect in structure.effects)
    force, x = structure.rig.units["force"], structure.rig.units["x"]
    energy = "J" if (force, x) in {("N m", "rad"), ("N", "m")} else f"{force} {x}"
    areas = [
        LoopArea(
            a,
            _derived(f"energy per cycle at {a:.3g} {x}", energy, loop_area(structure, draws, a), determined),
        )
        for a in (amplitudes if hysteretic else ())
    ]
    return DerivedQuantities(tuple(pairs), saturation, words, tuple(areas))


def parameter_draws(
    fit: FitResult, scales: Mapping[str, float], rng: np.random.Generator, n_draws: int
) -> Floats:
    """Return the fitted parameters and draws of their covariance, shape (n_parameters, 1 + n_draws)."""
    # The first column is the fit itself. Draws are made in search coordinates, in which a loop is nearly linear. Draws outside
    # the admissible range (an exponent below 1) are moved to its nearest point in the metric of the fit, as the fit itself is:
    # otherwise the interval of a parameter at its bound would not contain the fitted value. Undetermined parameters keep their
    # values.
    structure = fit.structure
    center = np.array([fit.values[name] for name in structure.names])
    draws = np.repeat(center[:, None], 1 + n_draws, axis=1)
    if not fit.free:
        return draws
    coordinates = Coordinates.of(structure, fit.free, fit.values, scales)
    theta = coordinates.from_values(fit.values)
    known = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)
    back = np.linalg.pinv(coordinates.jacobian(theta) / _sizes(known)[:, None])
    covariance = back @ (known / np.outer(_sizes(known), _sizes(known))) @ back.T
    # Coordinates differ by orders of magnitude, so the root of the correlation is computed.
    size = _sizes(covariance)
    eigenvalues, vectors = symmetric_eigen(covariance / np.outer(size, size))
    root = size[:, None] * vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    drawn = theta + rng.standard_normal((n_draws, theta.size)) @ root.T
    inside = _moved_inside(drawn, covariance, coordinates.lower, coordinates.upper)
    draws[:, 1:] = np.array([coordinates.to_parameters(each) for each in inside]).T
    return draws


def _moved_inside(drawn: Floats, covariance: Floats, lower: Floats, upper: Floats) -> Floats:
    """Move draws of shape (n_draws, n_free) to the bounds that they exceed; other coordinates follow by their correlation."""
    moved = drawn.copy()
    for i in range(lower.size):
        past = np.clip(moved[:, i], lower[i], upper[i]) - moved[:, i]
        if past.any() and covariance[i, i] > 0.0:
            moved += past[:, None] * covariance[i] / covariance[i, i]
    return np.clip(moved, lower, upper)


def _sizes(covariance: Floats) -> Floats:
    size = np.sqrt(np.diag(covariance))
    return np.asarray(np.where(size == 0.0, 1.0, size))


def loop_area(structure: Structure, p: Floats, amplitude: float) -> Floats:
    """Return the energy per cycle of the spring for parameter sets of shape (n_parameters, n_sets), shape (n_sets,).

    The effects that change the spring (its deflection or its torque) are simulated on a bench that moves them slowly and
    sinusoidally; the last of four cycles is used. Damping and friction parallel to the spring are left out.
    """
    effects = [e for e in structure.effects if e.spring is not None or e.deflection is not None]
    if not any(effect.spring is not None for effect in effects):
        raise InputError(
            f"No spring hysteresis among the effects ({', '.join(structure.effect_names) or 'none'}): there is no loop."
        )
    if not 0.0 < amplitude < np.inf:
        raise InputError(f"The amplitude of a loop must be positive, got {amplitude:g}.")
    bench = compose(built_in.ELEMENT, effects)
    known = dict(structure.fixed)
    values = np.zeros((len(bench.names), p.shape[1]))
    stiffness = structure.rig.motion.stiffness
    own = sorted(stiffness.free_symbols, key=lambda symbol: str(symbol.name))
    rows = [p[structure.names.index(symbol.name)] for symbol in own]
    values[bench.names.index("k")] = sp.lambdify(own, stiffness, "numpy")(*rows)
    for effect in effects:
        for parameter in effect.parameters:
            name = structure.parameter_name(effect, parameter.name)
            row = bench.names.index(bench.parameter_name(effect, parameter.name))
            values[row] = known[name] if name in known else p[structure.names.index(name)]
    # One radian per second: the hysteresis laws are rate-independent, and rate-dependent parts have no area of their own.
    phase = 2.0 * np.pi * np.arange(_CYCLES * _SAMPLES_PER_CYCLE + 1) / _SAMPLES_PER_CYCLE
    dt = 2.0 * np.pi / _SAMPLES_PER_CYCLE
    velocity = amplitude * np.cos(phase)
    held = hold_motion(amplitude * np.sin(phase), velocity, dt)
    rest = np.zeros((len(bench.states), p.shape[1]))
    force = simulate_sets(bench, held, values, rest, phase.size, _SUBSTEPS)[:, 0]
    last = slice(-_SAMPLES_PER_CYCLE, None)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(velocity[last] @ force[last] * dt)


def record_amplitudes(
    structure: Structure, records: Sequence[Record], values: Mapping[str, float]
) -> tuple[float, ...]:
    """Return the largest deflection of the spring in each record, in increasing order."""
    rig = structure.rig
    name = rig.outputs[0].name if rig.is_driven else rig.inputs[0].name
    rest = float(rig.motion.rest.subs({s: values[s.name] for s in rig.motion.rest.free_symbols}))
    return tuple(sorted({float(np.max(np.abs(record[name] - rest))) for record in records}))


def _determined(fit: FitResult) -> bool:
    """Return True if the records determine the spring and its effects; loops do not depend on other parameters."""
    structure = fit.structure
    own = {s.name for s in structure.rig.motion.stiffness.free_symbols}
    own |= {
        structure.parameter_name(effect, p.name) for effect in structure.effects for p in effect.parameters
    }
    return all(np.isfinite(error) for name, error in fit.standard_errors.items() if name in own)


def saturation_level(effect: Effect) -> sp.Expr | None:
    """Return the limit of the state of a spring with memory under increasing deflection, in terms of its parameters."""
    # None for an effect without such a spring, with several states, or whose state has no such limit (or several).
    if effect.spring is None or len(effect.states) != 1 or effect.states[0].limit is not None:
        return None
    (state,) = effect.states
    level = sp.Symbol("level", positive=True)
    # Solved for positive parameters, so that sympy knows the signs of roots; the formula holds for others where it is real.
    own = {sp.Symbol(p.name, real=True): sp.Symbol(p.name, positive=True) for p in effect.parameters}
    loading = state.rate.xreplace({canonical.deflection_rate: sp.Integer(1), state.symbol: level, **own})
    roots = sp.solve(loading, level) if loading.has(level) else []
    levels = [root for root in roots if root.is_positive]
    return levels[0].xreplace({there: here for here, there in own.items()}) if len(levels) == 1 else None


def _saturation(level: sp.Expr, own: Mapping[str, Floats]) -> Floats:
    """Return the limit for values of the parameters, infinite if there is none."""
    reached = sp.lambdify([sp.Symbol(name, real=True) for name in own], level, "numpy")
    with np.errstate(all="ignore"):
        found = np.asarray(reached(*own.values()), dtype=np.float64)
    return np.where(np.isfinite(found) & (found > 0.0), found, np.inf)


def _in_words(saturation: Derived, total: str) -> str:
    if not np.isfinite(saturation.value):
        return f"{total} is not positive: z grows without bound, and the spring never saturates."
    if not np.isfinite(saturation.upper):
        return (
            f"In these records {total} cannot be distinguished from zero: z may saturate from {saturation.lower:.3g} "
            f"{saturation.unit} on, or never. Record a larger amplitude to find out."
        )
    return (
        f"z saturates at {saturation.value:.3g} {saturation.unit} ({saturation.lower:.3g} to {saturation.upper:.3g} with "
        f"{LEVEL:.0%} confidence)."
    )


def _derived(name: str, unit: str, samples: Floats, determined: bool) -> Derived:
    """Take the value from the first sample and the interval from the others."""
    usable = samples[1:][~np.isnan(samples[1:])]
    if not determined or usable.size == 0:
        return Derived(name, unit, float(samples[0]), -np.inf, np.inf)
    # Quantiles without interpolation, because draws may be infinite.
    low, high = np.quantile(usable, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0], method="inverted_cdf")
    return Derived(name, unit, float(samples[0]), float(low), float(high))
