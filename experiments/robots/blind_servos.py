"""Blind trials with servos in MuJoCo: a controller, a gear, a delay or friction that the user's model lacks.

The controller is a program that runs once a millisecond, as in a servo; the user knows command and encoder alone.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from rigsight.effects import family_of
from rigsight.workflow.diagnose import run_diagnose

Floats = NDArray[np.float64]
DT, STEP, SECONDS, NOISE = 0.004, 0.001, 10.0, 2e-4
"""Sample time of the log and of the controller [s], length of a record [s], noise of the encoder [rad]."""
LAWS = ('signal = "k_p*(goal - angle)"\nforce = "motor"', 'signal = "goal"\nforce = "k_p*(motor - q)"')
"""The user's controller: as the signal of the drive, and as the force of a position drive, as simulators have it."""
HIDDEN = (
    "integral_action",
    "velocity_feedforward",
    "derivative_action",
    "controller_dead_band",
    "command_rate_limit",
    "command_filter",
    "friction_compensation",
    "flexible_mode",
    "command_delay",
    "coulomb_friction",
)
SAME = {("controller_dead_band", LAWS[0]): "input_dead_zone", ("command_filter", LAWS[1]): "actuator_lag"}
"""Effects of a drive that do the same: a dead zone of a signal that is proportional to the error, a lag of the goal."""
RIG = """name = "servo"
summary = "A position servo turns a link."
[inputs.goal]
unit = "rad"
[constants.m]
unit = "kg"
default = {mass}
[constants.l]
unit = "m"
default = {length}
[parameters.J]
unit = "kg m^2"
lower = 1e-6
default = {inertia}
[parameters.d]
unit = "N m s/rad"
lower = 0.0
default = {damping}
[parameters.k_p]
unit = "N m/rad"
lower = 1e-3
default = {gain}
[coordinates.q]
unit = "rad"
[energy]
kinetic = "(J + m*l^2)*d(q)^2/2"
{potential}
[joints.gearbox]
motion = "q"
damping = "d"
[drives.motor]
{law}
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
"""


@dataclass(frozen=True)
class Servo:
    """A servo and what its user does not know: the size of the hidden effect, relative to what is usual."""

    hidden: str
    size: float
    mass: float
    length: float
    gain: float
    damping: float
    armature: float
    hangs: bool
    reach: float
    law: str
    off: Floats  # factors of the user's numbers: inertia, damping, gain


def drawn(seed: int) -> Servo:
    """Draw a servo; every hidden effect comes once in as many trials as there are effects."""
    rng = np.random.default_rng([41, seed])
    mass, length = rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.25)
    gain = rng.uniform(8.0, 25.0) * mass * length
    inertia = rng.uniform(0.5, 2.0) * mass * length**2
    return Servo(
        HIDDEN[seed % len(HIDDEN)],
        rng.uniform(0.6, 1.6),
        mass,
        length,
        gain,
        rng.uniform(0.5, 1.0) * 2.0 * np.sqrt(gain * (inertia + mass * length**2)),
        inertia,
        bool(rng.integers(4)),
        rng.uniform(0.3, 0.7),
        LAWS[int(rng.integers(2))],
        rng.uniform(0.7, 1.4, 3),
    )


def controller(servo: Servo) -> Callable[[float, float], float]:
    """Return the program of the servo: torque of goal and reading, called once per `STEP`."""
    own = servo.size if servo.hidden in HIDDEN else 0.0
    state = {"z": 0.0, "last": 0.0, "slow": 0.0, "before": 0.0}
    late: list[float] = []

    def torque(goal: float, reading: float) -> float:
        if servo.hidden == "command_delay":
            late.append(goal)
            goal = late[-1 - min(len(late) - 1, round(0.02 * own / STEP))]
        elif servo.hidden == "command_filter":
            state["slow"] += (goal - state["slow"]) * (1.0 - np.exp(-STEP / (0.03 * own)))
            goal = state["slow"]
        elif servo.hidden == "command_rate_limit":
            most = 1.5 * own * servo.reach * STEP
            state["slow"] += float(np.clip(goal - state["slow"], -most, most))
            goal = state["slow"]
        error = goal - reading
        if servo.hidden == "controller_dead_band":
            error = float(np.sign(error) * max(0.0, abs(error) - 0.02 * own))
        output = servo.gain * error
        if servo.hidden == "integral_action":
            state["z"] += 3.0 * own * servo.gain * error * STEP
            output += state["z"]
        rate = {"velocity_feedforward": goal, "derivative_action": error, "friction_compensation": goal}
        if servo.hidden in rate:
            value = rate[servo.hidden]
            state["slow"] += ((value - state["last"]) / STEP - state["slow"]) * (1.0 - np.exp(-STEP / 0.005))
            state["last"] = value
            if servo.hidden == "friction_compensation":
                output += 0.05 * own * servo.gain * servo.reach * np.sign(state["slow"])
            else:
                output += 0.03 * own * servo.gain * state["slow"]
        return output

    return torque


def mjcf(servo: Servo) -> str:
    """Return the plant: rotor, gear and link."""
    axis = "0 1 0" if servo.hangs else "0 0 1"
    link = f'<geom type="sphere" pos="0 0 {-servo.length}" size="0.001" mass="{servo.mass}"/>'
    if not servo.hangs:
        link = f'<geom type="sphere" pos="{servo.length} 0 0" size="0.001" mass="{servo.mass}"/>'
    friction = 0.05 * servo.size * servo.gain * servo.reach if servo.hidden == "coulomb_friction" else 0.0
    turn = f'<joint name="q" axis="{axis}" damping="{servo.damping}" armature="{servo.armature}" frictionloss="{friction}"/>'
    if servo.hidden == "flexible_mode":
        # The link swings behind the gear at 4 to 10 Hz; the encoder sits at the rotor.
        stiffness = servo.mass * servo.length**2 * (2 * np.pi * 6.0 / servo.size) ** 2
        damping = 0.1 * np.sqrt(stiffness * servo.mass) * servo.length
        rotor = '<geom type="sphere" size="0.001" mass="1e-4"/>'
        turn += (
            f'{rotor}<body><joint axis="{axis}" stiffness="{stiffness}" damping="{damping}"/>{link}</body>'
        )
    else:
        turn += link
    return (
        f'<mujoco model="servo"><option timestep="{STEP}" integrator="implicitfast"/><default><geom contype="0"'
        f' conaffinity="0"/></default><worldbody><body>{turn}</body></worldbody>'
        '<actuator><motor name="m" joint="q"/></actuator></mujoco>'
    )


def moved(servo: Servo, goals: Floats) -> Floats:
    """Return the angle of the rotor at each sample of the log."""
    model = mujoco.MjModel.from_xml_string(mjcf(servo))
    data, program, found = mujoco.MjData(model), controller(servo), np.empty(goals.size)
    for k, goal in enumerate(goals):
        found[k] = data.qpos[0]
        for _ in range(round(DT / STEP)):
            data.ctrl[0] = program(float(goal), float(data.qpos[0]))
            mujoco.mj_step(model, data)
    return found


def write_campaign(servo: Servo, seed: int, folder: Path) -> None:
    """Write records, the user's rig and the campaign."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([42, seed])
    t = DT * np.arange(round(SECONDS / DT))
    sweep = 2 * np.pi * (0.15 * t + 1.0 * t**2 / SECONDS)
    lines = ['title = "Servo"', "[rig]", 'file = "servo.toml"']
    for name, size, speed in (("slow", 0.6, 0.5), ("fast", 1.0, 1.0), ("valid", 0.8, 0.8)):
        goals = size * servo.reach * np.sin(speed * sweep + size) * np.clip(t / 0.5, 0.0, 1.0)
        angle = moved(servo, goals) + rng.normal(scale=NOISE, size=goals.size)
        np.savetxt(
            folder / f"{name}.csv",
            np.column_stack([t, goals, angle]),
            delimiter=",",
            header="t,goal,angle",
            comments="",
        )
        role = "validation" if name == "valid" else "estimation"
        lines += [
            "[[records]]",
            f'file = "{name}.csv"',
            f'role = "{role}"',
            'kind = "operation"',
            'hold = "zoh"',
        ]
    potential = 'potential = "-m*9.81*l*cos(q)"' if servo.hangs else ""
    rig = RIG.format(
        mass=servo.mass,
        length=servo.length,
        inertia=servo.armature * servo.off[0],
        damping=servo.damping * servo.off[1],
        gain=servo.gain * servo.off[2],
        potential=potential,
        law=servo.law,
    )
    (folder / "servo.toml").write_text(rig, encoding="utf-8")
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def run_trial(seed: int, out: Path, n_jobs: int) -> dict[str, object]:
    """Diagnose a servo with the whole catalogue and return what came out."""
    servo, folder = drawn(seed), out / f"servo_{seed:02d}"
    write_campaign(servo, seed, folder)
    begun = time.perf_counter()
    diagnosis = run_diagnose(folder, folder / "results", seed=0, n_jobs=n_jobs)
    place = "gearbox" if servo.hidden in ("coulomb_friction", "flexible_mode") else "motor"
    first = diagnosis.families[0] if diagnosis.families else None
    best = diagnosis.candidates[0].parameters if diagnosis.candidates else {}
    gain = best.get("k_p")
    return {
        "seed": seed,
        "hidden": servo.hidden,
        "hangs": servo.hangs,
        "law": "signal" if servo.law == LAWS[0] else "force",
        "verdict": diagnosis.verdict,
        "named": list(diagnosis.effects),
        "right": {(family_of(e), w) for e, w in zip(diagnosis.effects, diagnosis.where, strict=False)}
        <= {
            (family_of(name), place)
            for name in (servo.hidden, SAME.get((servo.hidden, servo.law), servo.hidden))
        }
        and bool(diagnosis.effects),
        "probability": None if first is None else first.probability,
        "gain": None if gain is None else [gain.value / servo.gain, gain.std / servo.gain],
        "seconds": round(time.perf_counter() - begun, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, nargs=2, default=(0, 40), metavar=("FIRST", "END"))
    parser.add_argument("--out", type=Path, required=True, help="folder of the records and results")
    parser.add_argument("--jobs", type=int, default=1, help="processes of each diagnosis")
    choice = parser.parse_args()
    choice.out.mkdir(parents=True, exist_ok=True)
    for seed in range(*choice.trials):
        result = choice.out / f"servo_{seed:02d}.json"
        if not result.exists():
            result.write_text(json.dumps(run_trial(seed, choice.out, choice.jobs)), encoding="utf-8")
        print(result.read_text(encoding="utf-8"), flush=True)


if __name__ == "__main__":
    main()
