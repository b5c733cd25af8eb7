"""Residual of mujoco.sysid on records of MuJoCo plants with hidden effects, and the effects that rigsight names in them."""

from __future__ import annotations

import argparse
import json
import logging
import time
from pathlib import Path

import mujoco
import numpy as np
from blind_in_mujoco import DT, NOISE, drawn, write_records
from mujoco import sysid
from numpy.typing import NDArray

from rigsight.robots import sensor_readings

RUNS = ("run_1", "run_2", "valid")


def records_of(folder: Path, model: mujoco.MjModel) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return controls and readings of each record, shape (n, n_controls) and (n, n_sensors)."""
    found = []
    for name in RUNS:
        columns = np.loadtxt(folder / f"{name}.csv", delimiter=",", skiprows=1)
        found.append((columns[:, 1 : 1 + model.nu], columns[:, 1 + model.nu :]))
    return found


def fitted(xml: str, folder: Path, fields: tuple[str, ...], dt: float = DT) -> tuple[mujoco.MjModel, float]:
    """Return the model with fields of all joints fitted to the estimation records, and the seconds that took."""
    spec = mujoco.MjSpec.from_string(xml)
    model = spec.compile()
    params = sysid.ParameterDict()
    for joint in [model.joint(i).name for i in range(model.njnt)]:
        for field in fields:
            own = getattr(spec.joint(joint), field)
            here = float(np.atleast_1d(own)[0])
            parameter = sysid.Parameter(
                f"{joint}_{field}",
                nominal=here,
                min_value=0.0,
                max_value=10.0 * here + 0.5,
                modifier=lambda s, p, n=joint, f=field: _set(s.joint(n), f, float(p.value[0])),
            )
            parameter.value[:] = max(here, 0.02)
            params.add(parameter)
    runs = records_of(folder, model)[:2]
    # It stamps a reading with the time at the end of the step that it begins.
    controls, shown, states = [], [], []
    step = float(model.opt.timestep)
    for goals, readings in runs:
        held = np.repeat(goals, round(dt / step), axis=0)
        controls.append(
            sysid.TimeSeries(
                step * np.arange(len(held)), held, sysid.TimeSeries.compute_all_control_mapping(model)
            )
        )
        shown.append(
            sysid.TimeSeries(
                dt * np.arange(len(goals)) + step,
                readings,
                sysid.TimeSeries.compute_all_sensor_mapping(model),
            )
        )
        states.append(
            sysid.create_initial_state(model, np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.na))
        )
    sequences = sysid.ModelSequences("arm", spec, ["run_1", "run_2"], states, controls, shown)
    begun = time.perf_counter()
    best, _ = sysid.optimize(
        params, sysid.build_residual_fn(models_sequences=[sequences]), optimizer="mujoco", verbose=False
    )
    spent = time.perf_counter() - begun
    changed = mujoco.MjSpec.from_string(xml)
    for joint in [model.joint(i).name for i in range(model.njnt)]:
        for field in fields:
            _set(changed.joint(joint), field, float(best[f"{joint}_{field}"].value[0]))
    return changed.compile(), spent


def _set(joint: mujoco.MjsJoint, field: str, value: float) -> None:
    """Set a field of a joint; a damping is the first of three numbers."""
    own = getattr(joint, field)
    if np.ndim(own):
        own[0] = value
    else:
        setattr(joint, field, value)


def error(model: mujoco.MjModel, folder: Path, dt: float = DT) -> float:
    """Return the RMS error on the withheld record in noise floors, the worst of the sensors."""
    goals, readings = records_of(folder, model)[2]
    left = sensor_readings(model, goals, dt) - readings
    return float(np.max(np.sqrt(np.mean(left**2, axis=0)))) / NOISE


def row(seed: int, out: Path, results: Path) -> str:
    """Fit a trial with mujoco.sysid, and return it beside what rigsight found in the same records."""
    trial, folder = drawn(seed), out / f"trial_{seed:02d}"
    write_records(trial, seed, folder)
    before = error(mujoco.MjModel.from_xml_string(trial.model), folder)
    numbers, spent = fitted(trial.model, folder, ("damping", "armature"))
    dry, _ = fitted(trial.model, folder, ("damping", "armature", "frictionloss"))
    told = json.loads(
        (results / f"trial_{seed:02d}" / "results" / "diagnosis.json").read_text(encoding="utf-8")
    )
    seconds = json.loads((results / f"trial_{seed:02d}.json").read_text(encoding="utf-8"))["seconds"]
    candidate = told["candidates"][0]
    named = ", ".join(json.loads((results / f"trial_{seed:02d}.json").read_text(encoding="utf-8"))["named"])
    return (
        f"| {seed} | {trial.effect}@{trial.place} | {before:.0f} | {error(numbers, folder):.1f} | {error(dry, folder):.1f} | "
        f"{spent:.0f} | {named or told['verdict']} | {candidate['error_over_noise']:.1f} | {seconds:.0f} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True, help="folder for records")
    parser.add_argument("--results", type=Path, required=True, help="results of blind_in_mujoco.py")
    choice = parser.parse_args()
    logging.disable(logging.WARNING)
    print(
        "| trial | hidden | as given | sysid: damping, armature | sysid: and frictionloss | its seconds | rigsight names | "
        "left with it | its seconds |\n|---:|---|---:|---:|---:|---:|---|---:|---:|"
    )
    for seed in choice.trials:
        print(row(seed, choice.out, choice.results), flush=True)


if __name__ == "__main__":
    main()
