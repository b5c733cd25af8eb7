"""Free parameters of a calibration of hysteresis, and the special cases from which it starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from rigsight.errors import InputError, check_option
from rigsight.identify.start.declared_starts import declared_values, in_structure, moved_starts
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.units import characteristic_value


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
