"""Blind trials with random MuJoCo plants: MuJoCo's friction, an actuator with delay, a second joint as play."""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rigsight.robots import sensor_readings
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.init import run_init_from_mjcf

DT, STEP, SECONDS, NOISE = 0.004, 0.0005, 8.0, 2e-4
"""Sample time and MuJoCo's step [s], length of a record [s], noise of an encoder [rad]."""
EFFECTS = ("coulomb_friction", "input_delay", "free_play")
GEAR_STIFFNESS = 60.0
"""What the user's data sheet says of the gear [N m/rad]."""


@dataclass(frozen=True)
class Trial:
    """A plant with something hidden in it, and the model that a user has of it.

    Attributes
    ----------
    model, plant
        MJCF without and with the effect.
    effect, place
        What is hidden, and where.
    gears
        Joint -> stiffness, for `init --mjcf`.
    reach
        How far the controls move [rad], one for each joint.
    """

    model: str
    plant: str
    effect: str
    place: str
    gears: dict[str, float]
    reach: list[float]


def drawn(seed: int) -> Trial:
    """Draw a trial: an arm of one geared joint or of two links, and an effect of a size that shows."""
    rng = np.random.default_rng([22, seed])
    effect = EFFECTS[seed % 3]
    geared = effect == "free_play" or bool(rng.integers(2))
    names = ("axis",) if geared else ("shoulder", "elbow")
    lengths, masses = rng.uniform(0.2, 0.4, 2), rng.uniform(0.3, 1.0, 2)
    kp, kv = rng.uniform(10.0, 30.0, 2) * (1.0, 0.5), rng.uniform(0.1, 0.6, 2)
    armature, damping = rng.uniform(0.005, 0.02, 2), rng.uniform(0.1, 0.4, 2)
    reach = [float(r) for r in rng.uniform(0.3, 0.7, len(names))]
    at = int(rng.integers(len(names)))
    friction = float(rng.uniform(0.05, 0.2))
    delay = float(rng.uniform(0.006, 0.02))
    half = float(rng.uniform(0.005, 0.03))

    def text(hidden: str | None) -> str:
        bodies, actuators, sensors, ends = "", "", "", ""
        for i, name in enumerate(names):
            own = hidden is not None and i == at
            dry = f' frictionloss="{friction}"' if own and hidden == "coulomb_friction" else ""
            late = f' delay="{delay}" nsample="100"' if own and hidden == "input_delay" else ""
            bodies += f'<body name="link_{i}" pos="0 0 {-lengths[i - 1] if i else 1.0}">'
            bodies += (
                f'<joint name="{name}" axis="0 1 0" damping="{damping[i]}" armature="{armature[i]}"{dry}/>'
            )
            if own and hidden == "free_play":
                bodies += (
                    f'<joint name="{name}_slack" axis="0 1 0" range="{-half} {half}" solreflimit="0.01 0.7"/>'
                )
            elif geared and hidden is not None:
                bodies += f'<joint name="{name}_spring" axis="0 1 0" stiffness="{GEAR_STIFFNESS * 1.2}" damping="0.1"/>'
            bodies += (
                f'<geom type="capsule" fromto="0 0 0 0 0 {-lengths[i]}" size="0.015" mass="{masses[i]}"'
                ' contype="0" conaffinity="0"/>'
            )
            ends += "</body>"
            actuators += f'<position name="{name}" joint="{name}" kp="{kp[i]}" kv="{kv[i]}"{late}/>'
            sensors += f'<jointpos name="{name}_angle" joint="{name}"/>'
        return (
            f'<mujoco model="arm"><compiler angle="radian"/><option timestep="{STEP}" integrator="RK4"/>'
            f"<worldbody>{bodies}{ends}</worldbody><actuator>{actuators}</actuator><sensor>{sensors}</sensor></mujoco>"
        )

    place = {
        "coulomb_friction": names[at],
        "input_delay": f"{names[at]}_motor",
        "free_play": f"{names[at]}_gear",
    }
    return Trial(
        text(None), text(effect), effect, place[effect], {"axis": GEAR_STIFFNESS} if geared else {}, reach
    )


def controls(trial: Trial, run: int) -> NDArray[np.float64]:
    """Return chirps of the controls, shape (n, n_joints)."""
    t = DT * np.arange(round(SECONDS / DT))
    size = (0.6, 1.0, 0.8)[run]
    sweep = 2 * np.pi * (0.3 * t + 1.5 * t**2 / SECONDS) + run
    goals = [size * reach * np.sin((1.0, 1.6)[i] * sweep + i) for i, reach in enumerate(trial.reach)]
    return np.column_stack(goals) * np.clip(t / 0.5, 0.0, 1.0)[:, None]


def write_records(trial: Trial, seed: int, folder: Path) -> Path:
    """Write the model and what the plant did, and return the model's file."""
    folder.mkdir(parents=True, exist_ok=True)
    model = folder / "arm.xml"
    model.write_text(trial.model, encoding="utf-8")
    plant = mujoco.MjModel.from_xml_string(trial.plant)
    names = [plant.joint(int(plant.actuator_trnid[i, 0])).name for i in range(plant.nu)]
    header = ",".join(["t", *(f"{name}_motor_ctrl" for name in names), *(f"{name}_angle" for name in names)])
    rng = np.random.default_rng([23, seed])
    for run, name in enumerate(("run_1", "run_2", "valid")):
        goals = controls(trial, run)
        angles = sensor_readings(plant, goals, DT) + rng.normal(scale=NOISE, size=goals.shape)
        t = DT * np.arange(len(goals))
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack([t, goals, angles]),
            delimiter=",",
            header=header,
            comments="",
        )
    return model


def run_trial(seed: int, out: Path, n_jobs: int) -> dict[str, object]:
    """Diagnose a trial with the whole catalogue and return what came out."""
    trial, folder = drawn(seed), out / f"trial_{seed:02d}"
    model = write_records(trial, seed, folder)
    begun = time.perf_counter()
    run_init_from_mjcf(folder, model, gears=trial.gears)
    diagnosis = run_diagnose(folder, folder / "results", seed=0, n_jobs=n_jobs)
    hidden = f"{trial.effect}@{trial.place}"
    return {
        "seed": seed,
        "hidden": hidden,
        "verdict": diagnosis.verdict,
        "named": list(diagnosis.effects),
        "probability": diagnosis.candidates[0].probability if diagnosis.candidates else None,
        "right": list(diagnosis.effects) == [hidden],
        "seconds": round(time.perf_counter() - begun, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, nargs=2, default=(0, 30), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="folder of the records and results")
    parser.add_argument("--jobs", type=int, default=1, help="processes of each diagnosis")
    choice = parser.parse_args()
    choice.out.mkdir(parents=True, exist_ok=True)
    for seed in range(*choice.trials):
        result = choice.out / f"trial_{seed:02d}.json"
        if not result.exists():
            result.write_text(json.dumps(run_trial(seed, choice.out, choice.jobs)), encoding="utf-8")
        print(result.read_text(encoding="utf-8"), flush=True)


if __name__ == "__main__":
    main()
