"""Time of a diagnosis, its growth with the length of the records, and the time that scipy alone would need for one effect.

A running gear at 200 Hz: sweeps of 100 s at 0.25, 0.5 and 1 A and a step to fit, a sweep at 0.75 A to validate; every effect of
the catalogue is a candidate. Kernels are compiled before the clock starts. The median is over rigs with different effects.
"""

from __future__ import annotations

import os
import resource
import statistics
import sys
import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.effects import CATALOGUE, effect_named
from rigsight.excitation import log_sweep, step
from rigsight.records import Kind, Record, Role
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.workflow.run.kernels import prepare_kernels, structures_to_try

Floats = NDArray[np.float64]

DT = 5e-3
SWEEP = 100.0
NOISE = 2e-5
LINEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip
EFFECTS: Mapping[str, Mapping[str, float]] = {
    "cubic_stiffness": {"k_3": 6e4},
    "coulomb_friction": {"T_c": 0.05},
    "input_delay": {"T_d": 0.01},
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.4, "beta": 80.0, "gamma": 20.0, "n": 1.0},
    "quadratic_damping": {"c_2": 5.0},
}
LENGTHS = (1, 2, 4)
SIMULATIONS_PER_FIT = 80
"""Of each record: ten steps of least squares with forward differences for eight parameters."""


def campaign(effect: str, length: float) -> Campaign:
    rng = np.random.default_rng(0)
    structure = compose(RUNNING_GEAR, [effect_named(effect)])
    values = {**LINEAR, **EFFECTS[effect]}
    t = np.asarray(DT * np.arange(round(length / DT)), dtype=np.float64)
    short = np.asarray(DT * np.arange(3000), dtype=np.float64)
    drives: list[tuple[str, Role, Kind, float, Floats]] = [
        *((f"sweep {a} A", "estimation", "sweep", a, log_sweep(t, a, 1.0, 70.0)) for a in (0.25, 0.5, 1.0)),
        ("step", "estimation", "step", 0.6, step(short, 0.6, 5.0)),
        ("sweep 0.75 A", "validation", "sweep", 0.75, log_sweep(t, 0.75, 1.0, 70.0)),
    ]
    records = []
    for name, role, kind, amplitude, u in drives:
        driven = Record(name, DT, {"u": u}, {"u": "A"}, role=role, kind=kind, amplitude=amplitude)
        clean = simulate(structure, values, driven)
        noisy = {output: clean[output] + rng.normal(scale=NOISE, size=u.size) for output in ("psi", "y")}
        records.append(clean.with_signals(**noisy))
    constants = {p.name: LINEAR[p.name] for p in RUNNING_GEAR.constants}
    given = {**{p.name: LINEAR[p.name] for p in RUNNING_GEAR.parameters if p.name in LINEAR}, "k_c": 90.0}
    return Campaign(effect, RUNNING_GEAR, constants, given, tuple(records))


def diagnosed(measured: Campaign, n_jobs: int) -> tuple[float, tuple[str, ...]]:
    start = time.perf_counter()
    with threadpool_limits(limits=1, user_api="blas"):
        found = diagnose(
            measured, n_jobs=n_jobs, prepare=lambda s: prepare_kernels(s, n_jobs, lambda _: None)
        )
    return time.perf_counter() - start, found.effects


def peak_memory() -> float:
    """Return the peak memory of this process [MB]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def scipy_simulation(record: Record) -> float:
    """Return the time that scipy needs to simulate a record of the gear with a cubic spring once [s]."""
    t, u = record.t, record["u"]
    m, d, k, k_3 = LINEAR["J_z"], LINEAR["k_d"], LINEAR["k_c"], EFFECTS["cubic_stiffness"]["k_3"]
    gain = LINEAR["b"] * LINEAR["k_tau"] / LINEAR["r_0"]

    def rates(now: float, x: Floats) -> list[float]:
        drive = gain * np.interp(now, t, u)
        turn = (drive - d * x[1] - k * x[0] - k_3 * x[0] ** 3) / m
        return [x[1], turn, LINEAR["c_y"] * (x[0] - x[2] / (2.0 * LINEAR["l_0"]))]

    start = time.perf_counter()
    solve_ivp(rates, (t[0], t[-1]), [0.0, 0.0, 0.0], method="LSODA", t_eval=t, rtol=1e-6, atol=1e-9)
    return time.perf_counter() - start


def main() -> None:
    n_jobs = os.cpu_count() or 1
    prepare_kernels(structures_to_try(RUNNING_GEAR, CATALOGUE, ()), n_jobs, lambda _: None)
    diagnosed(campaign("cubic_stiffness", SWEEP), n_jobs)
    print(f"{len(CATALOGUE)} candidates, {n_jobs} at a time; records of {SWEEP:g} s at {1 / DT:g} Hz")
    times = []
    for effect in EFFECTS:
        seconds, named = diagnosed(campaign(effect, SWEEP), n_jobs)
        times.append(seconds)
        print(f"  {effect:24}{seconds:8.1f} s   named {', '.join(named) or 'none'}", flush=True)
    print(f"  median {statistics.median(times):.1f} s, peak memory {peak_memory():.0f} MB")
    first = 0.0
    for length in LENGTHS:
        seconds, _ = diagnosed(campaign("cubic_stiffness", length * SWEEP), n_jobs)
        first = first or seconds
        print(
            f"  records of {length * SWEEP:4.0f} s {seconds:8.1f} s   {seconds / first:5.2f} times the first",
            flush=True,
        )
    measured = campaign("cubic_stiffness", SWEEP)
    one = sum(scipy_simulation(record) for record in measured.records if record.role == "estimation")
    alone = SIMULATIONS_PER_FIT * one
    print(
        f"scipy (solve_ivp LSODA rtol 1e-6) simulates the four records once in {one:.1f} s: least_squares with finite "
        f"differences,\n  {SIMULATIONS_PER_FIT} simulations, would fit ONE effect in {alone:.0f} s, "
        f"{alone / statistics.median(times):.1f} times the diagnosis with all candidates"
    )


if __name__ == "__main__":
    main()
