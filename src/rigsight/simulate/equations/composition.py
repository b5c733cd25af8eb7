"""Composition of a rig and a tuple of effects into a structure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

import sympy as sp

from rigsight.effects import Effect, placed_dimension
from rigsight.effects.placed import ByIdentity
from rigsight.errors import InputError, check_option
from rigsight.parameters import Parameter
from rigsight.records.record import Record
from rigsight.rigs import RIGS, Rig, joint_of
from rigsight.simulate.equations.signal_path import equation_tree
from rigsight.simulate.equations.structure import Structure, ahead_name, bandwidth_name, unique_names


def compose(
    rig: Rig,
    effects: Iterable[Effect] = (),
    fixed: Mapping[str, float] | None = None,
    offsets: Iterable[str] = (),
    observed: Iterable[str] = (),
) -> Structure:
    """Insert effects into a rig's equations.

    Parameters
    ----------
    rig
        The rig.
    effects
        Effects in any order; they are sorted along the signal path.
    fixed
        Values of effect parameters to write into the equations as numbers (an exponent of 1 saves a power).
    offsets
        Names of sensors whose readings are shifted, each by a constant state; these states come last.
    observed
        Sensors of an observer, which corrects the motion towards their measured readings. The readings are inputs after those of
        the rig; the bandwidths are parameters after all others, zero if they are not given.

    Raises
    ------
    InputError
        If an effect does not apply to this rig or is given twice.

    Notes
    -----
    A parameter name that occurs twice is qualified by its effect (``stribeck_friction.T_c`` together with Coulomb friction).
    """
    chosen = tuple(sorted(effects, key=lambda e: (e.place.value, len(e.states), e.name)))
    return _compose(
        ByIdentity(rig),
        ByIdentity(chosen),
        tuple(sorted((fixed or {}).items())),
        _in_order(rig, offsets),
        _in_order(rig, observed),
    )


def _in_order(rig: Rig, sensors: Iterable[str]) -> tuple[str, ...]:
    asked = set(sensors)
    return tuple(sensor.name for sensor in rig.mechanism.sensors if sensor.name in asked)


def structure_of_fit(structure: Structure, records: Iterable[Record]) -> Structure:
    """Return the structure that is simulated in a fit to records, with their free offsets and observers, see `compose`.

    It is the same one if no record has any; those of sensors that the rig does not have are ignored.
    """
    records = list(records)
    offsets = {sensor for record in records for sensor in record.free_offsets}
    observed = {sensor for record in records for sensor in record.observed}
    if not offsets and not observed:
        return structure
    return compose(structure.rig, structure.effects, dict(structure.fixed), offsets, observed)


@lru_cache(maxsize=1024)
def _compose(
    rig_key: ByIdentity[Rig],
    effects_key: ByIdentity[tuple[Effect, ...]],
    fixed: tuple[tuple[str, float], ...],
    offsets: tuple[str, ...],
    observed: tuple[str, ...],
) -> Structure:
    rig, effects = rig_key.value, effects_key.value
    _check_effects(rig, effects)
    unique = unique_names(rig, effects)
    late = {rig.acts_at(effect) for effect in effects if effect.reading_delay is not None}
    named = [(bandwidth_name(s), f"bandwidth of the observer of {s}", "rad/s") for s in observed]
    named += [(ahead_name(s), f"lead time of the reading of {s}", "s") for s in observed if s in late]
    of_observer = [Parameter(name, meaning, unit=unit, default=0.0) for name, meaning, unit in named]
    parameters = (*_parameters(rig, effects, unique, dict(fixed)), *of_observer)
    symbols = {p.name: sp.Symbol(f"parameter {p.name}", real=True) for p in parameters}
    return Structure(
        rig=rig,
        effects=effects,
        fixed=fixed,
        parameters=parameters,
        parameter_symbols=tuple(symbols[p.name] for p in parameters),
        tree=equation_tree(rig, effects, symbols, unique, dict(fixed), offsets, observed),
        offsets=offsets,
        observed=observed,
    )


def _check_effects(rig: Rig, effects: tuple[Effect, ...]) -> None:
    names = [effect.name for effect in effects]
    for effect in effects:
        joint = joint_of(rig, effect)
        if effect.reads_inertia and joint.inertia is None and not rig.mechanism.has_short_inverse:
            raise InputError(
                f"Effect '{effect.name}' reads the inertia that moves with a joint, and its formula is too long on the rig "
                f"'{rig.name}'. Set inertia in joints.{joint.name} of the rig file."
            )
        if not rig.offers(effect):
            raise InputError(
                f"Effect '{effect.name}' does not apply to the rig '{rig.name}'. 'rigsight effects' lists all with their kind of "
                "place; the page of an effect says which rigs offer it."
            )
    if len(set(names)) < len(names):
        raise InputError(f"An effect is given twice: {', '.join(names)}.")


def _parameters(
    rig: Rig, effects: tuple[Effect, ...], unique: Mapping[tuple[str, str], str], fixed: Mapping[str, float]
) -> tuple[Parameter, ...]:
    of_effects = [
        replace(
            rig.with_unit(parameter, rig.acts_at(effect)),
            name=unique[effect.name, parameter.name],
            dimension=placed_dimension(effect, parameter.dimension),
        )
        for effect in effects
        for parameter in effect.parameters
    ]
    return (*rig.constants, *rig.parameters, *(p for p in of_effects if p.name not in fixed))


def structure_named(rig_name: str, effects: Iterable[Effect] = ()) -> Structure:
    """Compose a rig given by its name."""
    return compose(RIGS[check_option("Rig", rig_name, RIGS)], effects)


def without_vanished_effects(
    structure: Structure, values: Mapping[str, float]
) -> tuple[Structure, dict[str, float]]:
    """Leave out the effects whose parameters are at the values at which they vanish."""
    # A vanished lag would divide by its time constant, and every vanished kink would still cost events.
    known = {**dict(structure.fixed), **values}

    def vanished(effect: Effect) -> bool:
        null = effect.null_values()
        return bool(null) and structure.values_of(effect, known).items() >= null.items()

    kept = [effect for effect in structure.effects if not vanished(effect)]
    if len(kept) == len(structure.effects):
        return structure, dict(values)
    bare = compose(structure.rig, kept)
    renamed = {
        structure.parameter_name(effect, p.name): bare.parameter_name(effect, p.name)
        for effect in kept
        for p in effect.parameters
    }
    fixed = {renamed[name]: value for name, value in structure.fixed if name in renamed}
    return compose(structure.rig, kept, fixed), {
        renamed.get(name, name): value for name, value in values.items()
    }
