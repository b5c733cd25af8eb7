"""Free parameters of a calibration of hysteresis, and the special cases from which it starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import sympy as sp

from rigsight.effects import symbols as canonical
from rigsight.effects.effect import Effect, Start
from rigsight.errors import InputError, check_option
from rigsight.rigs import evaluated
from rigsight.simulate import Structure, compose
from rigsight.units import characteristic_value


def free_parameters(structure: Structure, outputs: Collection[str]) -> tuple[str, ...]:
    """Return the parameters that records of these outputs determine, without constants and those of unmeasured outputs."""
    rig = structure.rig
    motion = rig.motion
    moved = {
        s.name
        for e in (motion.stiffness, motion.damping, motion.inertia)
        if e is not None
        for s in e.free_symbols
    }
    rest = {symbol.name for symbol in motion.rest.free_symbols}
    bias = {symbol.name for symbol in motion.bias.free_symbols}
    # With a spring a constant force is equivalent to a shifted rest position; a bench has no rest position.
    moved |= rest or bias
    for state, rate in rig.downstream.items():
        if state.name in outputs:
            moved |= {symbol.name for symbol in rate.free_symbols}
    of_rig = {p.name for p in rig.parameters}
    fixed = dict(structure.fixed)
    of_effects = {
        structure.parameter_name(effect, p.name)
        for effect in structure.effects
        for p in effect.parameters
        if p.fitted
    }
    return tuple(name for name in structure.names if name in (moved & of_rig) | (of_effects - fixed.keys()))


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
    """Return a value for every parameter: the given one, else the first start value of its effect, else the default.

    Values of effects are placeholders if a search over the whole range follows.
    """
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
    sizes = {
        canonical.drive_size: scales["drive"],
        canonical.input_size: scales["input"],
        canonical.x_size: scales["x"],
        canonical.v_size: scales["x"] / scales["time"],
        canonical.time_size: scales["time"],
    }
    return [
        {**begin, **own_sizes, **_moved(structure, effect, start, begin, sizes)}
        for effect in structure.effects
        for start in effect.starts
        if start.parent is None
    ]


def neighbors(structure: Structure, values: Mapping[str, float]) -> list[dict[str, float]]:
    """Return the start values that the effects declare for another fit: a fit may have ended in a nearby local minimum."""
    return [
        {**values, **_moved(structure, effect, start, structure.values_of(effect, values), {})}
        for effect in structure.effects
        for start in effect.starts
        if start.parent == effect.name
    ]


def _moved(
    structure: Structure,
    effect: Effect,
    start: Start,
    values: Mapping[str, float],
    sizes: Mapping[sp.Symbol, float],
) -> dict[str, float]:
    """Return the parameters that a declared start of an effect changes, by their names in the structure."""
    motion = structure.rig.motion
    known = dict(sizes)
    # If the stiffness of the rig depends on several parameters, only the effect's own ones are changed.
    for symbol, part in ((canonical.k, motion.stiffness), (canonical.m, motion.inertia)):
        if sizes and part is not None:
            known[symbol] = evaluated(part, values)
    moved = {}
    for name, formula in start.values.items():
        own = {symbol: values[symbol.name] for symbol in formula.free_symbols if symbol not in known}
        value = float(formula.subs({**known, **own}))
        if name != str(canonical.k):
            moved[structure.parameter_name(effect, name)] = value
        elif isinstance(motion.stiffness, sp.Symbol):
            moved[motion.stiffness.name] = value
    return {name: value for name, value in moved.items() if name in structure.names}
