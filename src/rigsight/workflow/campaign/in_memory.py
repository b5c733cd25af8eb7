"""Make campaigns and models from records and values in memory, without files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from rigsight.campaign import Campaign
from rigsight.effects import Effect, effect_named
from rigsight.errors import InputError, check_option
from rigsight.parameters import ParameterSet
from rigsight.records import Hold, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import RIGS, Rig, rig_of_tables
from rigsight.simulate import compose
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.campaign_file import Offsets, Where, checked_numbers, checked_simulation
from rigsight.workflow.campaign.read_campaign import of_first_record
from rigsight.workflow.campaign.record_notes import in_units_of, record_notes, rig_in_units_of
from rigsight.workflow.own.own_effects import effects_on


def make_campaign(
    rig: str | Rig,
    records: Sequence[Record],
    *,
    constants: Mapping[str, float] | None = None,
    parameters: Mapping[str, float] | None = None,
    effects: Sequence[str | Effect] = (),
    title: str = "",
    offsets: Offsets = "shared",
) -> Campaign:
    """Make a campaign of records in memory.

    Parameters
    ----------
    rig
        Name of a built-in rig (``rigsight rigs`` lists them), or a rig of your own.
    records
        With distinct names; each holds the inputs and outputs of the rig, in SI units where its `units` state no other: those are
        converted, with a note. Outputs may be missing, all but the first of ``"running_gear"``, ``"axis"`` and ``"element"``, all
        but one of others. Roles say which may be fitted.
    constants
        Known numbers of the rig by name [SI].
    parameters
        Parameter values of the given simulation [SI]; missing ones are identified from the records.
    effects
        Effects that this simulation has already, by name or as declarations.
    title
        What a report calls the campaign; by default the name of the rig.
    offsets
        ``"per_record"`` if each sensor has its own offset in each record: it is estimated and not part of the model.

    Raises
    ------
    InputError
        Naming the value, effect, record or signal that cannot be used, and what is allowed.

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
    found = rig_in_units_of(rig_of(rig), records)
    called = title or found.name
    by_record = set.intersection(*(set(record.constants) for record in records)) if records else set()
    modelled = effects_on(found, effects_of(effects), called)
    known, given = checked_simulation(
        Where(called), found, modelled, constants or {}, parameters or {}, by_record
    )
    if all(record.role != "estimation" for record in records):
        raise InputError(
            f'{called}: records: none has role = "estimation", so nothing can be fitted. Give at least one record this role.'
        )
    taken = [record.name for record in records]
    twice = sorted({name for name in taken if taken.count(name) > 1})
    if twice:
        raise InputError(
            f"{called}: records: several have the name '{twice[0]}'. Give every record a different name."
        )
    check_option("offsets", offsets, get_args(Offsets))
    checked = tuple(_checked(called, record, found) for record in records)
    if offsets == "per_record":
        checked = tuple(
            record.with_free_offsets(signal.name for signal in found.outputs) for record in checked
        )
    constants, differing = of_first_record(found, known, checked)
    return Campaign(
        title=called,
        rig=found,
        constants=constants,
        parameters=given,
        records=checked,
        modelled=tuple(modelled),
        notes=tuple(note for note in (differing, *record_notes(called, found, checked)) if note),
    )


def make_model(
    rig: str | Rig, values: Mapping[str, float], effects: Sequence[str | Effect] = (), hold: Hold = "foh"
) -> Model:
    """Make a model from values in memory.

    Parameters
    ----------
    rig
        Name of a built-in rig (``rigsight rigs`` lists them), or a rig of your own.
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
    found = rig_of(rig)
    structure = compose(found, effects_on(found, effects_of(effects), found.name))
    defaults = {p.name: p.default for p in structure.parameters if p.default is not None}
    complete = ParameterSet.from_mapping(structure.parameters, {**defaults, **values})
    return Model(structure, complete.to_mapping(), hold)


def rig_of(rig: str | Rig) -> Rig:
    """Return a rig that was given by the name of a built-in one, or as it is."""
    if isinstance(rig, str):
        return RIGS[check_option("The rig", rig, RIGS)]
    # A rig with the same declaration is reused if there is one, so that its equations are derived only once.
    return rig_of_tables(rig.declaration, f"Rig '{rig.name}'") if rig.declaration else rig


def effects_of(effects: str | Effect | Sequence[str | Effect]) -> tuple[Effect, ...]:
    """Return effects that were given by name or as declarations."""
    # A single string is a sequence of letters too.
    given = (effects,) if isinstance(effects, str | Effect) else effects
    return tuple(effect if isinstance(effect, Effect) else effect_named(effect) for effect in given)


def _checked(called: str, record: Record, rig: Rig) -> Record:
    """Return a record in the units of its rig."""
    outputs = rig.required_outputs or tuple(s.name for s in rig.outputs if s.name in record)
    if not outputs:
        listed = ", ".join(signal.name for signal in rig.outputs)
        raise InputError(f"Record '{record.name}' has none of the outputs {listed}; give at least one.")
    inputs = [signal.name for signal in rig.inputs]
    may_rest = record.kind == "operation" and record.amplitude is None
    must_move = {name: "input" for name in rig.moving_inputs if record.role == "estimation"}
    begins_with_step = record.kind == "step" and any(record[name][0] != 0.0 for name in inputs)
    may_rest = may_rest or begins_with_step
    if record.role == "estimation" and not may_rest and all(is_constant(record[name]) for name in inputs):
        must_move |= dict.fromkeys(inputs, "input")
    if rig.required_outputs or all(is_constant(record[name]) for name in outputs):
        must_move |= dict.fromkeys(outputs, "output")
    for name in (*inputs, *outputs):
        if is_constant(record[name]) and name in must_move:
            raise InputError(
                f"Record '{record.name}': the {must_move[name]} {name} never changes ({record[name][0]:g}), so nothing can "
                "be identified from it. Check the signal, or leave the record out. For a record of free motion, set kind = "
                '"operation" and give no amplitude.'
            )
    checked_numbers(
        Where(f"{called}: record '{record.name}'"), ("constants",), rig, rig.constants, record.constants
    )
    return in_units_of(rig, record)
