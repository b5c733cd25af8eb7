"""The work of `rigsight simulate`: a model and the input of a record -> the outputs that the model predicts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from rigsight.effects import Effect
from rigsight.errors import InputError, nearest
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import ColumnMapping, Floats, Record, read_record
from rigsight.records.read_record import TIME
from rigsight.rigs import Rig
from rigsight.simulate import (
    Model,
    Structure,
    parameter_vector,
    record_input,
    record_values,
    rest_state,
    simulate,
    without_vanished_effects,
)
from rigsight.workflow.campaign.campaign_file import Where, checked_numbers
from rigsight.workflow.campaign.model_file import MODEL_FILE, named_model
from rigsight.workflow.campaign.read_campaign import options_of
from rigsight.workflow.campaign.record_notes import in_units_of
from rigsight.workflow.run.results import check_target, csv_text, write_together


def run_simulate(
    model: str | Path,
    record: str | Path,
    out: str | Path | None = None,
    *,
    columns: Mapping[str, ColumnMapping] | None = None,
    initial_state: Mapping[str, float] | Literal["estimated"] | None = None,
    constants: Mapping[str, float] | None = None,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
) -> Record:
    """Simulate a model for the inputs of a record."""
    read = named_model(model, own_effects, own_rigs)
    rig = read.structure.rig
    columns = columns or {}
    known = [TIME, *(signal.name for signal in rig.inputs)]
    estimated = initial_state == "estimated"
    if estimated:
        known += [signal.name for signal in rig.outputs]
    for name in columns:
        if name not in known:
            raise InputError(
                f"Column mapping '{name}': a simulation of {rig.name} does not use it.{nearest(name, known)} "
                f"It uses: {', '.join(known)}."
            )
    own = checked_numbers(Where(MODEL_FILE), ("constants",), rig.name, rig.constants, constants or {})
    if out is not None:
        check_target(Path(out))
        if Path(out).exists() and Path(record).exists() and Path(out).samefile(record):
            raise InputError(
                f"Cannot write {out}: it is the record that is simulated. Name another file with --out."
            )
    driven = read_record(
        Path(record),
        rig.inputs,
        rig.outputs if estimated else (),
        replace(
            options_of(rig),
            columns=columns,
            require_outputs=estimated,
            beside=(),
            hold=read.hold,
            constants=own,
        ),
    )
    simulated = simulate_model(read, driven, initial_state)
    if out is not None:
        names = [signal.name for signal in (*rig.inputs, *rig.outputs)]
        file = Path(out)
        write_together(file.parent, {file.name: csv_text(simulated, names)})
    return simulated


def simulate_model(
    model: Model,
    record: Record,
    initial_state: Mapping[str, float] | Literal["estimated"] | None = None,
) -> Record:
    """Simulate a model for the inputs of a record.

    Parameters
    ----------
    model
        The model.
    record
        Its inputs are simulated, with its hold and its own constants; its outputs are read only where initial states are
        estimated. Signals in other units than those of the rig are converted, with a note.
    initial_state
        States by name (an output's name stands for its state) that do not start at the static equilibrium at the first
        input sample; ``"estimated"`` fits all of them to the outputs measured in the record, and nothing else.

    Returns
    -------
    A copy of the record with the outputs that the model predicts, shape (n_samples,) each.

    Raises
    ------
    InputError
        If the record lacks an input, the unit of a signal is unknown or measures something else, an initial state is unknown, or
        states cannot be estimated from the record.
    SimulationError
        If the motion leaves the range of numbers or the model is too stiff.

    Examples
    --------
    >>> import numpy as np
    >>> import rigsight as rs
    >>> given = {"m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
    >>> model = rs.make_model("axis", {"gain": 1.0, **given})
    >>> push = rs.Record("push", dt=0.01, signals={"u": np.repeat([0.0, 4.0], [10, 1000])}, units={"u": "N"})
    >>> moved = rs.simulate_model(model, push)
    >>> print(f"{1e3 * moved['x'][-1]:.2f} mm at rest")
    5.00 mm at rest
    """
    record = in_units_of(model.structure.rig, record)
    state = None
    if initial_state == "estimated":
        state = _estimated_state(model, record)
    elif isinstance(initial_state, Mapping) and initial_state:
        state = _initial_state(model, record, initial_state)
    return simulate(model.structure, model.values, record, state)


def _initial_state(model: Model, record: Record, given: Mapping[str, float]) -> Floats:
    structure = model.structure
    names = list(structure.state_names)
    # If an output equals a state, users know the state by the name of the output.
    sensors = structure.rig.mechanism.sensors
    aliases = {s.name: s.reads.name for s in sensors if s.reads in structure.states}
    simulated, values = without_vanished_effects(structure, record_values(structure, model.values, record))
    rest = rest_state(simulated, parameter_vector(simulated, values), record_input(simulated, record))
    state = _of_all_effects(structure, simulated, rest)
    for name, value in given.items():
        own = aliases.get(name, name)
        if own not in names:
            known = list(dict.fromkeys([*aliases, *(n for n in names if n not in aliases.values())]))
            raise InputError(
                f"Initial state '{name}' is unknown.{nearest(name, known)} The model's states: {', '.join(known) or 'none'}."
            )
        if not math.isfinite(value):
            raise InputError(f"Initial state '{name}' must be a finite number, got {value}.")
        state[names.index(own)] = value
    return state


def _estimated_state(model: Model, record: Record) -> Floats:
    rig = model.structure.rig
    noise = {s.name: float(np.std(record[s.name])) or 1.0 for s in rig.outputs if s.name in record}
    scales = characteristic_scales(rig, [record], model.values)
    simulated, values = without_vanished_effects(model.structure, model.values)
    result = GreyBoxFit(simulated, [record], scales, noise).fit(values, [])
    if not result.residuals:
        raise InputError(f"The initial state cannot be estimated: {result.message}")
    return _of_all_effects(model.structure, simulated, result.rig_states[0])


def _of_all_effects(complete: Structure, simulated: Structure, state: Floats) -> Floats:
    """Return a state of the simulated equations as one of all effects; states of vanished effects are not used and are zero."""
    if simulated is complete:
        return state
    known = dict(zip(simulated.states, map(float, state), strict=False))
    return np.array([known.get(symbol, 0.0) for symbol in complete.states])
