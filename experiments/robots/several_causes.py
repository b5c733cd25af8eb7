"""Arms of three or six joints in MuJoCo with causes at several places: which are named, with which share?"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rigsight.effects import family_of
from rigsight.robots import sensor_readings
from rigsight.workflow.diagnose import run_diagnose
from rigsight.workflow.init import run_init_from_mjcf

Floats = NDArray[np.float64]
JOINTS = ("turn", "lift", "elbow", "roll", "bend", "twist")
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
ASIDE = (0.1, 0.0, 0.0, 0.0, 0.0, 0.05)
"""How far each link reaches beside the one above [m]."""
WEAKER = (1.0, 1.0, 0.6, 0.2, 0.2, 0.1)
"""Gains, damping and rotors of the joints as a share of those of the first two."""
DT, STEP, SECONDS, NOISE = 0.004, 0.001, 10.0, 2e-4
"""Sample time and MuJoCo's step [s], length of a record [s], noise of an encoder [rad]."""
AT_JOINT = ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "torque_ripple")
AT_DRIVE = ("input_delay", "actuator_lag")
MOVED = (0.01, 0.02)
"""By how much a cause alone changes the readings [rad], RMS."""


@dataclass(frozen=True)
class Cause:
    """What the user's model lacks: an effect, the number of its joint, its size, and the periods per turn of a ripple."""

    effect: str
    joint: int
    size: float
    periods: int = 1

    @property
    def place(self) -> str:
        return f"{JOINTS[self.joint]}_motor" if self.effect in AT_DRIVE else JOINTS[self.joint]


@dataclass(frozen=True)
class Arm:
    """Numbers of an arm, one for each joint, and the causes that its model lacks."""

    lengths: Floats
    masses: Floats
    gains: Floats
    damping: Floats
    armature: Floats
    given: Floats
    reach: Floats
    causes: tuple[Cause, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        return JOINTS[: len(self.lengths)]

    def mjcf(self, causes: Sequence[Cause], armature: Floats) -> str:
        """Return the arm as MJCF with the causes that MuJoCo knows."""
        friction, late, lagging = np.zeros((3, len(self.joints)))
        for cause in causes:
            for effect, sizes in (
                ("coulomb_friction", friction),
                ("input_delay", late),
                ("actuator_lag", lagging),
            ):
                if cause.effect == effect:
                    sizes[cause.joint] = cause.size
        bodies, actuators, sensors = "", "", ""
        for i, name in enumerate(self.joints):
            at = f"0 0 {-self.lengths[i - 1] if i > 1 else (1.0 if i == 0 else 0.0)}"
            bodies += (
                f'<body name="link_{i}" pos="{at}"><joint name="{name}" axis="{AXES[i]}" damping="{self.damping[i]}"'
                f' armature="{armature[i]}" frictionloss="{friction[i]}"/>'
                f'<geom type="capsule" fromto="0 0 0 {ASIDE[i]} 0 {-self.lengths[i] if i else 0}"'
                f' size="0.02" mass="{self.masses[i]}" contype="0" conaffinity="0"/>'
            )
            delay = f' delay="{late[i]}" nsample="100"' if late[i] else ""
            lag = f' timeconst="{lagging[i]}"' if lagging[i] else ""
            actuators += (
                f'<position name="{name}" joint="{name}" kp="{self.gains[i]}" kv="{0.03 * self.gains[i]}"'
                f"{delay}{lag}/>"
            )
            sensors += f'<jointpos name="{name}_angle" joint="{name}"/>'
        return (
            f'<mujoco model="arm"><compiler angle="radian"/><option timestep="{STEP}" integrator="RK4"/>'
            f"<worldbody>{bodies}{'</body>' * len(self.joints)}</worldbody><actuator>{actuators}</actuator>"
            f"<sensor>{sensors}</sensor></mujoco>"
        )

    def moved(self, causes: Sequence[Cause], controls: Floats) -> Floats:
        """Return the angles of the arm with these causes, shape (n, n_joints)."""

        def passive(_: mujoco.MjModel, data: mujoco.MjData) -> None:
            for cause in causes:
                q, v = float(data.qpos[cause.joint]), float(data.qvel[cause.joint])
                if cause.effect == "quadratic_damping":
                    data.qfrc_passive[cause.joint] -= cause.size * v * abs(v)
                elif cause.effect == "cubic_stiffness":
                    data.qfrc_passive[cause.joint] -= cause.size * q**3
                elif cause.effect == "torque_ripple":
                    data.qfrc_passive[cause.joint] -= cause.size * np.sin(cause.periods * q)

        plant = mujoco.MjModel.from_xml_string(self.mjcf(causes, self.armature))
        mujoco.set_mjcb_passive(passive)
        try:
            return sensor_readings(plant, controls, DT)
        finally:
            mujoco.set_mjcb_passive(None)

    def shares(self) -> list[float]:
        """Return how much of the squared gap each cause makes up: what the readings change by without it."""
        controls = self.controls(2)
        full = self.moved(self.causes, controls)
        gap = float(np.sum((full - self.moved((), controls)) ** 2))
        return [
            float(np.sum((full - self.moved([c for c in self.causes if c is not own], controls)) ** 2)) / gap
            for own in self.causes
        ]

    def sized(self, cause: Cause, change: float) -> Cause:
        """Return the cause with the size at which it alone changes the readings by `change` [rad], RMS."""
        controls = self.controls(2)
        without = self.moved((), controls)
        for _ in range(3):
            moved = float(np.std(self.moved((cause,), controls) - without))
            cause = replace(cause, size=cause.size * change / moved)
        return cause

    def controls(self, run: int) -> Floats:
        """Return sweeps of the goals, shape (n, n_joints)."""
        t = DT * np.arange(round(SECONDS / DT))
        sweep = 2 * np.pi * (0.2 * t + 1.2 * t**2 / SECONDS) + run
        goals = [
            (0.6, 1.0, 0.8)[run] * reach * np.sin((1.0, 1.6, 1.3, 0.8, 1.9, 1.1)[i] * sweep + i)
            for i, reach in enumerate(self.reach)
        ]
        return np.column_stack(goals) * np.clip(t / 0.5, 0.0, 1.0)[:, None]


def drawn(seed: int, n_joints: int = 3, n_causes: int | None = None) -> Arm:
    """Draw an arm and three to five causes at it, or so many, each of a size that is felt at its joint."""
    rng, n, weaker = np.random.default_rng([31, seed]), n_joints, np.array(WEAKER[:n_joints])
    light = weaker if n > 3 else np.ones(n)  # a wrist is short and light
    spots = [(e, i) for e in AT_JOINT for i in range(n)] + [(e, i) for e in AT_DRIVE for i in range(n)]
    lengths, masses = rng.uniform(0.2, 0.35, n) * np.sqrt(light), rng.uniform(0.3, 0.9, n) * light
    gains = rng.uniform(15.0, 40.0, n) * weaker
    armature = rng.uniform(0.005, 0.03, n) * light
    causes: list[Cause] = []
    for at in rng.permutation(len(spots)):
        effect, joint = spots[at]
        if any(c.joint == joint and family_of(c.effect) == family_of(effect) for c in causes):
            continue
        size = {
            "coulomb_friction": 0.02 * gains[joint],
            "quadratic_damping": 0.01 * gains[joint],
            "cubic_stiffness": 0.2 * gains[joint],
            "torque_ripple": 0.02 * gains[joint],
            "input_delay": 0.01,
            "actuator_lag": 0.01,
        }[effect]
        causes.append(Cause(effect, joint, float(size), int(rng.integers(8, 30))))
        if len(causes) == (n_causes or 3 + seed % 3):
            break
    arm = Arm(
        lengths,
        masses,
        gains,
        rng.uniform(0.1, 0.5, n) * light,
        armature,
        armature * rng.uniform(0.5, 1.5, n),
        rng.uniform(0.4, 0.7, n),
        tuple(causes),
    )
    return replace(arm, causes=tuple(arm.sized(cause, rng.uniform(*MOVED)) for cause in causes))


def write_records(arm: Arm, seed: int, folder: Path) -> None:
    """Write the user's model of an arm and three records of the true one."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "arm.xml").write_text(arm.mjcf((), arm.given), encoding="utf-8")
    rng = np.random.default_rng([32, seed])
    header = ",".join(["t", *(f"{j}_motor_ctrl" for j in arm.joints), *(f"{j}_angle" for j in arm.joints)])
    for run, name in enumerate(("run_1", "run_2", "valid")):
        goals = arm.controls(run)
        angles = arm.moved(arm.causes, goals) + rng.normal(scale=NOISE, size=goals.shape)
        rows = np.column_stack([DT * np.arange(len(goals)), goals, angles])
        np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="")


def run_arm(arm: Arm, seed: int, folder: Path, n_jobs: int) -> dict[str, object]:
    """Diagnose an arm with the whole catalogue and return what came out."""
    write_records(arm, seed, folder)
    begun = time.perf_counter()
    run_init_from_mjcf(folder, folder / "arm.xml")
    diagnosis = run_diagnose(folder, folder / "results", seed=0, n_jobs=n_jobs)
    seconds = time.perf_counter() - begun
    named = {(own.family, own.where): own for own in diagnosis.families}
    hidden = []
    for cause, share in zip(arm.causes, arm.shares(), strict=True):
        own = named.get((family_of(cause.effect), cause.place))
        hidden.append(
            {
                "effect": cause.effect,
                "where": cause.place,
                "share": share,
                "named": any(
                    effect.partition("@")[2] == cause.place
                    and family_of(effect.partition("@")[0]) == family_of(cause.effect)
                    for effect in diagnosis.effects
                ),
                "probability": None if own is None else own.probability,
                "stated_share": None if own is None else [own.share, *own.interval],
            }
        )
    return {
        "seed": seed,
        "verdict": diagnosis.verdict,
        "effects": list(diagnosis.effects),
        "hidden": hidden,
        "seconds": round(seconds, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arms", type=int, nargs=2, default=(0, 10), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="folder of the records and results")
    parser.add_argument("--jobs", type=int, default=1, help="processes of each diagnosis")
    choice = parser.parse_args()
    choice.out.mkdir(parents=True, exist_ok=True)
    for seed in range(*choice.arms):
        result = choice.out / f"arm_{seed:02d}.json"
        if not result.exists():
            own = run_arm(drawn(seed), seed, choice.out / f"arm_{seed:02d}", choice.jobs)
            result.write_text(json.dumps(own), encoding="utf-8")
        print(result.read_text(encoding="utf-8"), flush=True)


if __name__ == "__main__":
    main()
