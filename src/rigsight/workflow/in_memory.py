"""How do records and numbers that are in memory become a campaign or a model, without files?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from rigsight.effects import Effect, effect_named
from rigsight.errors import InputError, check_option
from rigsight.parameters import ParameterSet
from rigsight.records import Hold, Record
from rigsight.records.plausibility import is_constant
from rigsight.rigs import RIGS, Rig
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign import NO_VALIDATION, Campaign, checked_simulation


def make_campaign(
    rig: str,
    records: Sequence[Record],
    *,
    constants: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    effects: Sequence[str | Effect] = (),
    title: str = "",
) -> Campaign:
    """Make a campaign of records in memory.

    Parameters
    ----------
    rig
        ``"running_gear"``, ``"axis"`` or ``"element"``.
    records
        With distinct names; each holds the inputs and the first output of the rig in SI units. Roles say which may be fitted.
    constants
        Known numbers of the rig by name [SI].
    parameters
        The simulation whose gap is in question [SI]; what is missing is identified from the records.
    effects
        Effects that this simulation has already, by name or as declarations.
    title
        What a report calls the campaign; by default the name of the rig.

    Raises
    ------
    InputError
        Naming the number, effect, record or signal that cannot be used, and what is allowed.

    Examples
    --------
    >>> import numpy as np
    >>> import rigsight as rs
    >>> u = np.sin(np.linspace(0.0, 60.0, 1000) ** 1.5)
    >>> record = rs.Record("sweep", dt=0.01, signals={"u": u, "x": 0.01 * u}, units={"u": "N", "x": "m"})
    >>> campaign = rs.make_campaign("axis", [record], parameters={"k": 100.0})
    >>> campaign.rig.name, campaign.parameters, len(campaign.estimation)
    ('axis', {'k': 100.0}, 1)
    """
    called = title or rig
    modelled = effects_of(effects)
    names = [effect.name for effect in modelled]
    given = checked_simulation(called, rig, names, constants or {}, parameters or {}, modelled)
    if all(record.role != "estimation" for record in records):
        raise InputError(
            f'{called}: records: none has role = "estimation", so nothing can be fitted. Give at least one that role.'
        )
    taken = [record.name for record in records]
    twice = sorted({name for name in taken if taken.count(name) > 1})
    if twice:
        raise InputError(
            f"{called}: records: several are called '{twice[0]}'. Give every record a name of its own."
        )
    judged = any(record.role == "validation" for record in records)
    return Campaign(
        title=called,
        path=None,
        rig=given.rig,
        modelled=given.modelled,
        constants=given.constants,
        parameters=given.parameters,
        records=tuple(_checked(record, given.rig) for record in records),
        notes=() if judged else (NO_VALIDATION.format(file=called),),
    )


def make_model(
    rig: str, values: Mapping[str, float], effects: Sequence[str | Effect] = (), hold: Hold = "foh"
) -> Model:
    """Make a model of numbers in memory.

    Parameters
    ----------
    rig
        ``"running_gear"``, ``"axis"`` or ``"element"``.
    values
        Constants of the rig, its parameters and those of the effects, by name [SI]; one with a default may be missing.
    effects
        Effects of the model, by name or as declarations.
    hold
        How its input behaves between samples.

    Raises
    ------
    InputError
        Naming what is unknown, missing or out of range, and what is allowed.

    Examples
    --------
    >>> import rigsight as rs
    >>> model = rs.make_model("axis", {"m": 2.0, "d": 5.0, "k": 800.0, "k_3": 5e6}, ["cubic_stiffness"])
    >>> model.to_json()["effect_parameters"]
    {'k_3': 5000000.0}
    """
    structure = compose(RIGS[check_option("The rig", rig, RIGS)], effects_of(effects))
    defaults = {p.name: p.default for p in structure.parameters if p.default is not None}
    complete = ParameterSet.from_mapping(structure.parameters, {**defaults, **values})
    return Model(structure, complete.to_mapping(), hold)


def effects_of(effects: str | Effect | Sequence[str | Effect]) -> tuple[Effect, ...]:
    """Return effects that were given by name or as declarations.

    Parameters
    ----------
    effects
        One or several.

    Raises
    ------
    InputError
        Naming the nearest and all effects of the catalogue where a name is unknown.
    """
    # A lone name is a sequence too, of letters.
    given = (effects,) if isinstance(effects, str | Effect) else effects
    return tuple(effect if isinstance(effect, Effect) else effect_named(effect) for effect in given)


def _checked(record: Record, rig: Rig) -> Record:
    """Return a record with the units of its rig where it has none.

    Raises
    ------
    InputError
        If it lacks a signal that every record of the rig has, or one of them never changes.
    """
    for signal in (*rig.inputs, rig.outputs[0]):
        is_input = signal in rig.inputs
        if is_constant(record[signal.name]) and (record.role == "estimation" or not is_input):
            what = "input" if is_input else "output"
            raise InputError(
                f"Record '{record.name}': the {what} {signal.name} never changes ({record[signal.name][0]:g}), so nothing can "
                "be learned from it. Check the signal, or leave the record out."
            )
    units = {signal.name: signal.unit for signal in (*rig.inputs, *rig.outputs) if signal.name in record}
    return replace(record, units={**units, **record.units})
