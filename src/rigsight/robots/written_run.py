"""What does a written MuJoCo model leave of measured records, beside the model that was written into it?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigsight.errors import InputError
from rigsight.metrics import nrmse
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.robots.free_run import driven_run
from rigsight.robots.locked_joints import lock
from rigsight.robots.writing_back import WrittenModel, write_back
from rigsight.simulate import simulate
from rigsight.simulate.model import Model


@dataclass(frozen=True)
class WrittenGap:
    """NRMSE of one sensor, of all records together."""

    sensor: str
    in_mujoco: float  # with the written model
    in_model: float


def gap_of_written(
    model: Model, source: Path, records: Sequence[Record], starts: Sequence[Floats]
) -> tuple[WrittenGap, ...]:
    """Simulate records with a model and with the MuJoCo model into which it is written, both from one state.

    Parameters
    ----------
    model
        The model that is written; constants of a record replace its own, in both.
    source
        MJCF or URDF file from which the rig was made.
    records
        With the controls and readings of the rig.
    starts
        State of the model at the first sample of each, shape (n_states,) each.

    Raises
    ------
    InputError
        If a record lacks a control of the MuJoCo model, or no record has a reading of it.
    """
    measured: dict[str, list[Floats]] = {}
    residuals: dict[str, list[tuple[Floats, Floats]]] = {}
    written: dict[tuple[tuple[str, float], ...], WrittenModel] = {}
    for record, state in zip(records, starts, strict=True):
        own = replace(model, values={**model.values, **record.constants})
        key = tuple(sorted(record.constants.items()))
        if key not in written:
            written[key] = write_back(own, source)
        start = dict(zip(model.structure.state_names, map(float, state), strict=True))
        in_mujoco = _readings(written[key], record, start, own.values)
        in_model = simulate(model.structure, own.values, record, state)
        for name in (s.name for s in model.structure.rig.outputs if s.name in record and s.name in in_mujoco):
            measured.setdefault(name, []).append(record[name])
            residuals.setdefault(name, []).append(
                (record[name] - in_mujoco[name], record[name] - in_model[name])
            )
    if not measured:
        raise InputError(
            "No record has a reading that the MuJoCo model has too: give a campaign of the rig's records."
        )
    found = []
    for name, readings in measured.items():
        parts = (np.concatenate(part) for part in zip(*residuals[name], strict=True))
        found.append(WrittenGap(name, *(nrmse(part, np.concatenate(readings)) for part in parts)))
    return tuple(found)


def _readings(
    written: WrittenModel, record: Record, start: Mapping[str, float], values: Mapping[str, float]
) -> dict[str, Floats]:
    """Return what the sensors of a MuJoCo model show along a record; positions of joints where it has none."""
    import mujoco

    model, draft = written.model, written.draft
    controls = np.zeros((record.n_samples, model.nu))
    for name, index in draft.controls.items():
        if index < 0:
            continue
        if name not in record:
            raise InputError(f"Record '{record.name}' has no signal '{name}', a control of the MuJoCo model.")
        controls[:, model.actuator_ctrladr[index]] = record[name]
    n_steps = max(1, round(record.dt / float(model.opt.timestep)))
    model.opt.timestep = record.dt / n_steps
    data, coordinates = mujoco.MjData(model), draft.positions(model)
    for name, place in coordinates.items():
        data.qpos[place] = start[name]
    for name, place in draft.rates(model).items():
        data.qvel[place] = start[f"d({name})"]
    lock(model, data, draft.held(values))
    shown, positions = driven_run(model, data, controls, n_steps)
    places = {sensor.name: str(sensor.reads) for sensor in draft.rig.mechanism.sensors}
    return {
        name: shown[:, model.sensor_adr[index]] if index >= 0 else positions[:, coordinates[places[name]]]
        for name, index in draft.sensors.items()
        if index >= 0 or places[name] in coordinates
    }
