"""Free parameters of a calibration of hysteresis, and the special cases from which it starts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from rigsight.errors import InputError, check_option
from rigsight.simulate import Structure, compose


def free_parameters(structure: Structure, outputs: Collection[str]) -> tuple[str, ...]:
    """Return what records of these outputs determine: no constants, nothing of an output that was not measured.

    Parameters
    ----------
    structure
        Rig and effects.
    outputs
        Names of measured outputs.
    """
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
    """Return the names in the order of the structure.

    Raises
    ------
    InputError
        If one is unknown or there is none.
    """
    for name in free:
        check_option("A parameter to calibrate", name, structure.names)
    if not free:
        raise InputError("A calibration needs at least one free parameter, got none.")
    return tuple(name for name in structure.names if name in free)


def special_structure(structure: Structure, free: Sequence[str]) -> tuple[Structure, tuple[str, ...]]:
    """Write the special cases of the effects (an exponent of 1) into the equations: simulations are ten times faster then.

    Returns
    -------
    structure
        The same object if there is nothing to write.
    free
        What is left to move.
    """
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
    """Return a value for every parameter: the given one, else the default, else the middle of what its effect suggests.

    Values of effects are placeholders where a search over the whole range follows.

    Raises
    ------
    InputError
        Listing parameters of the rig that have neither.
    """
    of_rig = {p.name for p in (*structure.rig.constants, *structure.rig.parameters)}
    values = {p.name: p.default for p in structure.parameters if p.default is not None}
    values |= {p.name: p.starts[0] for p in structure.parameters if p.name not in of_rig and p.starts}
    values |= {name: value for name, value in start.items() if name in structure.names}
    missing = [name for name in structure.names if name not in values]
    if missing:
        raise InputError(f"Start values are missing for: {', '.join(missing)}.")
    return values
