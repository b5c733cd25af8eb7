"""A drive train of a user's own in a file, with records of it: what campaigns of rigs of any shape are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.records import Record
from rigsight.rigs import Rig, rig_file_text
from rigsight.workflow.campaign.in_memory import make_model
from rigsight.workflow.simulate import simulate_model

Floats = NDArray[np.float64]
T = 5e-3 * np.arange(200)
TRAIN = {"J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
ARM = {"I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02}
CURRENT = {"u": np.sin(8.0 * T + 6.0 * T**2)}
TORQUES = {"tau_1": 0.5 * np.sin(9.0 * T), "tau_2": 0.2 * np.sin(14.0 * T)}
PENDULUM = """
name = "pendulum"
summary = "A pendulum swings."
[constants.m]
unit = "kg"
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "m*0.3^2*d(q)^2/2"
potential = "-m*9.81*0.3*cos(q)"
[joints.pivot]
motion = "q"
damping = "d"
[sensors.angle]
reads = "q"
unit = "rad"
"""
CAMPAIGN = f"""
[rig]
file = "train.toml"
effects = ["cubic_stiffness@shaft"]
[rig.parameters]
{chr(10).join(f"{name} = {value}" for name, value in TRAIN.items())}
k_3 = 300.0
[[records]]
file = "both.csv"
[[records]]
file = "motor.csv"
role = "validation"
constants = {{ k_t = 0.06 }}
"""


def simulated(
    rig: str | Rig,
    values: Mapping[str, float],
    inputs: Mapping[str, Floats],
    effects: Sequence[str] = (),
    **constants: float,
) -> Record:
    record = Record("run", T[1], dict(inputs) or {"t": T}, {}, constants=constants)
    return simulate_model(make_model(rig, values, effects), record)


def write_record(path: Path, record: Record, names: Sequence[str]) -> None:
    table = np.column_stack([record.t, *(record[name] for name in names)])
    np.savetxt(path, table, fmt="%.15g", delimiter=",", header=",".join(["t", *names]), comments="")


def write_train_campaign(folder: Path, text: str = CAMPAIGN) -> Path:
    """Write a campaign whose second record lacks a sensor and has another motor."""
    own = rig_file_text("drive_train").replace('name = "drive_train"', 'name = "train"')
    (folder / "train.toml").write_text(own, encoding="utf-8")
    for name, sensors, k_t in (
        ("both", ("motor_angle", "load_angle"), 0.05),
        ("motor", ("motor_angle",), 0.06),
    ):
        record = simulated(
            "drive_train", {**TRAIN, "k_3": 300.0}, CURRENT, ["cubic_stiffness@shaft"], k_t=k_t
        )
        write_record(folder / f"{name}.csv", record, ("u", *sensors))
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return folder
