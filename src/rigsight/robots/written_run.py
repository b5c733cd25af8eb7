"""What does a written MuJoCo model leave of measured records, beside the model that was written into it?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigsight.errors import InputError
from rigsight.metrics import nrmse
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.robots.draft import RigDraft
from rigsight.simulate import simulate
from rigsight.simulate.model import Model

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True)
class WrittenGap:
    """NRMSE of one sensor, of all records together."""

    sensor: str
    there: float  # of MuJoCo with the written model
    here: float  # of the model


def gap_of_written(
    written: mujoco.MjModel,
    draft: RigDraft,
    model: Model,
    records: Sequence[Record],
    starts: Sequence[Floats],
) -> tuple[WrittenGap, ...]:
    """Simulate records with a written model and with its source, both from one state.

    Parameters
    ----------
    written
        The MuJoCo model with the numbers and effects.
    draft
        How its parts are called in the rig.
    model
        The model that was written.
    records
        With the signals of the rig.
    starts
        State of the model at the first sample of each, shape (n_states,) each.

    Raises
    ------
    InputError
        If a record lacks a control of the MuJoCo model, or its sensors are none of those of the rig.
    """
    measured: dict[str, list[Floats]] = {}
    residuals: dict[str, list[tuple[Floats, Floats]]] = {}
    for record, state in zip(records, starts, strict=True):
        values = {**model.values, **{k: v for k, v in record.constants.items() if k in model.values}}
        here = simulate(model.structure, values, record, state)
        start = dict(zip(model.structure.state_names, state, strict=True))
        there = _readings(written, draft, record, start)
        for name in (s.name for s in model.structure.rig.outputs if s.name in record and s.name in there):
            measured.setdefault(name, []).append(record[name])
            residuals.setdefault(name, []).append((record[name] - there[name], record[name] - here[name]))
    if not measured:
        raise InputError(
            "No record has a reading that the MuJoCo model has too: give a campaign of the rig's records."
        )
    found = []
    for name, readings in measured.items():
        own = np.concatenate(readings)
        parts = (np.concatenate(part) for part in zip(*residuals[name], strict=True))
        found.append(WrittenGap(name, *(nrmse(part, own) for part in parts)))
    return tuple(found)


def _readings(
    model: mujoco.MjModel, draft: RigDraft, record: Record, start: dict[str, float]
) -> dict[str, Floats]:
    """Return what the sensors of the MuJoCo model show along a record; positions of joints where it has none."""
    import mujoco

    missing = [name for name, index in draft.controls.items() if index >= 0 and name not in record]
    if missing:
        raise InputError(
            f"Record '{record.name}' has no signal '{missing[0]}', a control of the MuJoCo model."
        )
    n_steps = max(1, round(record.dt / float(model.opt.timestep)))
    model.opt.timestep = record.dt / n_steps
    data = mujoco.MjData(model)
    joints = {name: draft.index_with_gears(index) for name, index in draft.joints.items()}
    joints |= {gear.coordinate: draft.index_with_gears(gear.joint) + 1 for gear in draft.gears.values()}
    for name, joint in joints.items():
        data.qpos[model.jnt_qposadr[joint]] = start[name]
        data.qvel[model.jnt_dofadr[joint]] = start[f"d({name})"]
    controls = np.zeros((record.n_samples, model.nu))
    for name, index in draft.controls.items():
        if index >= 0:
            controls[:, model.actuator_ctrladr[index]] = record[name]
    shown = np.empty((record.n_samples, model.nsensordata))
    moved = np.empty((record.n_samples, model.nq))
    for row, (control, reading) in enumerate(zip(controls, shown, strict=True)):
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        reading[:], moved[row] = data.sensordata, data.qpos
        mujoco.mj_step(model, data, n_steps)
    reads = {sensor.name: str(sensor.reads) for sensor in draft.rig.mechanism.sensors}
    return {
        name: shown[:, model.sensor_adr[index]]
        if index >= 0
        else moved[:, model.jnt_qposadr[joints[reads[name]]]]
        for name, index in draft.sensors.items()
        if index >= 0 or reads[name] in joints
    }
