"""Runs of a MuJoCo model: freely beside its rig from the same state, under given controls, and along records when written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rigsight.errors import InputError
from rigsight.metrics import nrmse
from rigsight.records import Floats, Record
from rigsight.rigs import Rig, rig_of_tables
from rigsight.robots.draft import RigDraft, with_known_constants
from rigsight.robots.tree import lock
from rigsight.robots.writing_back import WrittenModel, write_back
from rigsight.simulate import Model, compose, simulate

if TYPE_CHECKING:
    import mujoco

STEP, SAMPLES, STEPS_PER_SAMPLE = 1e-4, 500, 10
"""MuJoCo's step [s], samples that are compared, and steps from each to the next."""
ALLOWED = 1e-5
"""Largest relative difference of equations that are the same. Two integrators leave 1e-8 with a stiff gear, 1e-11 without."""
_CONTROL = (-0.2, 0.2)
"""Range of a control that has none of its own, in its unit: a joint is to move some degrees."""
_ACCURACY = 1e-8
_WATCHED = "watched_"
_WAY = {False: 0.4, True: 0.05}
"""How far from its reference a hinge [rad] or slide [m] starts."""

_WHOLE = 1e-6
"""How far a sample time may be from a whole number of steps, in steps."""


@dataclass(frozen=True)
class FreeRun:
    """A run of both."""

    duration: float  # of the run [s]
    # Coordinate -> largest difference, relative to how far the coordinate moves.
    differences: dict[str, float]
    left_out: tuple[str, ...]  # descriptions of what was switched off in both
    allowed: float = ALLOWED  # largest difference of equations that are the same

    @property
    def worst(self) -> float:
        """Largest of the differences."""
        return max(self.differences.values())

    @property
    def agrees(self) -> bool:
        """True if the equations are the same."""
        return self.worst <= self.allowed


def free_run(model: mujoco.MjModel, draft: RigDraft) -> FreeRun:
    """Let a rig and the model that it comes from run freely from one state, under constant controls.

    MuJoCo uses the Runge-Kutta method of fourth order with a small step. What is not in a rig file is switched off in it:
    contacts, ranges and equality constraints. Dry friction is off in both, because MuJoCo's creeps where it should stick.
    """
    import copy

    import mujoco

    off = mujoco.mjtDisableBit
    own = copy.copy(model)
    own.opt.timestep, own.opt.integrator = STEP, int(mujoco.mjtIntegrator.mjINT_RK4)
    binding = () if draft.is_as_it_is else (off.mjDSBL_CONTACT, off.mjDSBL_EQUALITY, off.mjDSBL_LIMIT)
    for flag in (*binding, off.mjDSBL_FRICTIONLOSS):
        own.opt.disableflags |= int(flag)
    own.actuator_delay[:] = 0.0
    # The same filter, which the method of fourth order integrates as well: MuJoCo's exact one is of first order beside it.
    exact = own.actuator_dyntype == int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
    own.actuator_dyntype[exact] = int(mujoco.mjtDyn.mjDYN_FILTER)
    data = mujoco.MjData(own)
    rng = np.random.default_rng(0)
    joints, coordinates = draft.joint_of_coordinates(), draft.positions(own)
    for name in draft.joints:
        slides = int(own.jnt_type[joints[name]]) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        data.qpos[coordinates[name]] += _WAY[slides] * rng.uniform(-1.0, 1.0)
    # No part of an attitude stays where it is, so that each has a motion to compare with.
    turning = {name: place for joint in draft.free_joints for name, place in joint.rates.items()}
    data.qvel[list(turning.values())] = rng.uniform(-1.0, 1.0, len(turning))
    for index in (index for index in draft.controls.values() if index >= 0):
        low, high = own.actuator_ctrlrange[index] if own.actuator_ctrllimited[index] else _CONTROL
        data.ctrl[index] = rng.uniform(low, high)
    lock(own, data, draft.held({}))
    rates = {f"d({name})": float(data.qvel[place]) for name, place in turning.items()}
    start, reported = data.qpos.copy(), data.ctrl.copy()
    theirs = np.empty((SAMPLES, own.nq))
    for row in theirs:
        row[:] = data.qpos
        mujoco.mj_step(own, data, STEPS_PER_SAMPLE)
    ours = _ours(draft, {name: start[place] for name, place in coordinates.items()}, rates, reported)
    differences = {}
    for name, place in coordinates.items():
        moved = np.ptp(theirs[:, place])
        differences[name] = float(np.max(np.abs(ours[name] - theirs[:, place])) / max(moved, 1e-12))
    friction = ("dry friction",) if np.any(model.dof_frictionloss) else ()
    return FreeRun(STEP * STEPS_PER_SAMPLE * (SAMPLES - 1), differences, friction)


def _ours(
    draft: RigDraft, start: dict[str, float], rates: dict[str, float], reported: Floats
) -> dict[str, Floats]:
    """Return the coordinates of the rig along the run, shape (SAMPLES,) each."""
    rig = watched(draft)
    structure = compose(rig, [])
    dry = {
        name for name, fields in draft.fields.items() if any(f.attribute == "frictionloss" for f in fields)
    }
    values = {name: 0.0 if name in dry else value for name, value in draft.values.items()}
    held = {control: reported[index] for control, index in draft.controls.items() if index >= 0}
    # A record has a signal, also of a model without actuators.
    signals = {name: np.full(SAMPLES, held.get(name, 0.0)) for name in rig.signal_units}
    record = Record("free run", STEP * STEPS_PER_SAMPLE, signals, rig.signal_units, hold="zoh")
    state = np.array([{**start, **rates}.get(state.name, 0.0) for state in structure.states])
    out = simulate(structure, values, record, state, _ACCURACY)
    return {name: out[f"{_WATCHED}{name}"] for name in start}


def watched(draft: RigDraft) -> Rig:
    """Return a rig with a sensor at every coordinate and attitude instead of its own sensors."""
    turned = {name for joint in draft.free_joints for name in joint.quaternion}
    shown = draft.tables["coordinates"] | {name: draft.tables["states"][name] for name in turned}
    sensors = {f"{_WATCHED}{name}": {"reads": name, "unit": own["unit"]} for name, own in shown.items()}
    tables = with_known_constants({**draft.tables, "sensors": sensors}, draft.tables.get("constants", {}))
    return rig_of_tables(tables, "the rig from the model")


def sensor_readings(model: mujoco.MjModel, controls: Floats, dt: float) -> Floats:
    """Run a model by its own integrator from where it is drawn, at rest."""
    import mujoco

    controls = np.asarray(controls, dtype=np.float64)
    if controls.ndim != 2 or controls.shape[1] != model.nu:
        raise InputError(f"Controls have shape (n_samples, {model.nu}) for this model, got {controls.shape}.")
    steps = dt / float(model.opt.timestep)
    if round(steps) < 1 or abs(steps - round(steps)) > _WHOLE:
        raise InputError(
            f"dt must be a multiple of the model's step of {model.opt.timestep:g} s, got {dt:g} s."
        )
    return driven_run(model, mujoco.MjData(model), controls, round(steps))[0]


def driven_run(
    model: mujoco.MjModel, data: mujoco.MjData, controls: Floats, n_steps: int
) -> tuple[Floats, Floats]:
    """Run a model from a state under controls that hold for so many steps: sensors and positions before each."""
    import mujoco

    readings, positions = np.empty((len(controls), model.nsensordata)), np.empty((len(controls), model.nq))
    for control, reading, position in zip(controls, readings, positions, strict=True):
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        reading[:], position[:] = data.sensordata, data.qpos
        mujoco.mj_step(model, data, n_steps)
    return readings, positions


@dataclass(frozen=True)
class WrittenGap:
    """NRMSE of one sensor, of all records together."""

    sensor: str
    in_mujoco: float  # with the written model
    in_model: float


def gap_of_written(
    model: Model, source: Path, records: Sequence[Record], starts: Sequence[Floats]
) -> tuple[WrittenGap, ...]:
    """Simulate records with a model and with the MuJoCo model into which it is written, both from these states."""
    # Constants of a record replace those of the model, in both.
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
