"""What is known of each board before its records are read: equations, starts, and how its records are split and scored."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

RIGS = Path(__file__).parent / "rigs"

Beginning = Literal["samples", "rest", "periodic"]


@dataclass(frozen=True)
class Board:
    """One board.

    Every official split, number of initial samples and metric is that of `nonlinear_benchmarks` 1.0.1; where it states none, this
    file does.
    """

    loader: str  # function of nonlinear_benchmarks
    files: tuple[str, ...]  # where that function looks, in the folder of its name
    archive: str  # what it takes for downloaded
    rig: str  # built-in rig, or a file in rigs/
    output: str  # sensor that is scored
    unit: str  # of the number of the board
    scale: float  # that unit in the unit of the sensor
    start: Mapping[str, float]  # starts of the fit, and what is known
    initial_samples: int  # that the board leaves out of its number, and from which the initial state follows
    effects: tuple[str, ...] = ()
    hold: Literal["zoh", "foh", "band_limited"] = "zoh"
    objective: Literal["windows", "free-run"] = "free-run"
    held_out: float = 0.5  # last share of each training record that the chosen equations are validated on
    dt: float | None = None  # sample time [s] that the loader does not state
    clock: str | None = None  # input that is the time since the record began
    # How official test records begin, by a part of their names; from their first samples where none is named.
    begins: Mapping[str, Beginning] = field(default_factory=dict)


BOARDS = {
    "silverbox": Board(
        loader="Silverbox",
        files=("SilverboxFiles/SNLS80mV.mat",),
        archive="SilverboxFiles.zip",
        rig="axis",
        effects=("cubic_stiffness", "asymmetric_stiffness", "quadratic_damping"),
        output="x",
        unit="mV",
        scale=1e3,
        start={
            "m": 5.4e-6,
            "d": 2e-4,
            "k": 1.0,
            "x_off": 0.0,
            "force_off": 0.0,
            "k_3": 4.0,
            "k_2": 0.0,
            "c_2": 1e-7,
        },
        initial_samples=50,
        hold="band_limited",
        held_out=0.25,
    ),
    "bouc_wen": Board(
        loader="BoucWen",
        files=tuple(
            f"BoucWenFiles/Test signals/Validation signals/{side}val_{kind}.mat"
            for kind in ("multisine", "sinesweep")
            for side in "uy"
        ),
        archive="Hysteretic Benchmark with a Dynamic Nonlinearity_1_all.zip",
        rig="axis",
        effects=("bouc_wen_hysteresis",),
        output="x",
        unit="m",
        scale=1.0,
        start={
            "m": 2.0,
            "d": 10.0,
            "k": 9e4,
            "x_off": 0.0,
            "force_off": 0.0,
            "A": 1.0,
            "a": 0.6,
            "beta": 1000.0,
            "gamma": -800.0,
            "n": 1.0,
        },
        initial_samples=200,
        hold="band_limited",
        objective="windows",
        held_out=0.25,
        dt=1.0 / 750.0,
        begins={"multisine": "periodic", "sinesweep": "rest"},
    ),
    "emps": Board(
        loader="EMPS",
        files=("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"),
        archive="EMPS.zip",
        rig="emps.toml",
        effects=("coulomb_friction@rail",),
        output="y",
        unit="mm",
        scale=1e3,
        start={"m": 90.0, "d": 200.0, "d_a": 0.0, "force_off": 0.0, "drift": 0.0, "T_c": 20.0},
        initial_samples=20,
        hold="foh",
        clock="since",
    ),
    "coupled_drives": Board(
        loader="CED",
        files=("DATAUNIF.MAT",),
        archive="FULLTEXT01.zip",
        rig="coupled_drives.toml",
        effects=("rectified_sensor@speed",),
        output="speed",
        unit="ticks/s",
        scale=1.0,
        start={"J_m": 0.1, "J_p": 0.1, "k": 20.0, "d_b": 0.1, "d_m": 0.1, "r": 1.0},
        initial_samples=10,
        held_out=0.25,
    ),
    "cascaded_tanks": Board(
        loader="Cascaded_Tanks",
        files=("CascadedTanksFiles/dataBenchmark.mat",),
        archive="CascadedTanksFiles.zip",
        rig="cascaded_tanks.toml",
        output="y",
        unit="V",
        scale=1.0,
        start={"k_u": 0.05, "k_1": 0.2, "k_2": 0.2, "rim": 8.0, "share": 0.5, "rim_2": 9.5},
        initial_samples=50,
        held_out=0.3,
    ),
}
