"""What a communication step costs: a rig around an FMU for co-simulation, as rigsight asks it and by the usual coupling."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from same_verdict import GIVEN, cart

from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

Floats = NDArray[np.float64]

DT, SECONDS = 0.005, 2.0
STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 5e-3)


def rates(state: Floats, forces: Floats) -> Floats:
    """Return the rates of two coordinates and of their rates."""
    return np.concatenate(
        [state[2:], cart.accelerations(state[:2], state[2:], forces, {"mass": GIVEN["m_p"]})]
    )


def coupled(record: Record, step: float) -> Floats:
    """Return the angle where forces at communication points are held until the next one."""
    per_sample, inner = round(DT / step), max(1, round(step / 1e-3))
    u = np.interp(step * np.arange(record.n_samples * per_sample), record.t, record["u"])
    state, h, angles = np.zeros(4), step / inner, []
    for k, voltage in enumerate(u):
        if k % per_sample == 0:
            angles.append(state[1])
        push = GIVEN["k_u"] * voltage - GIVEN["k_c"] * state[0] - GIVEN["d_c"] * state[2]
        forces = np.array([push, -GIVEN["d_p"] * state[3]])
        for _ in range(inner):
            slope = rates(state, forces)
            state = state + 0.5 * h * (slope + rates(state + h * slope, forces))
    return np.array(angles)


def main() -> None:
    t = DT * np.arange(round(SECONDS / DT))
    record = Record("sweep", DT, {"u": 3.0 * np.sin(2 * np.pi * (0.5 + 0.5 * t) * t)}, {"u": "V"}, hold="foh")
    wanted = simulate(
        compose(rig_of_text(cart.RIG + cart.NATIVE)), GIVEN, record, np.zeros(4), accuracy=1e-8
    )["angle"]
    print("| communication step, s | error as rigsight asks, % | by the usual coupling, % |\n|---|---:|---:|")
    with tempfile.TemporaryDirectory() as name:
        path = cart.written_fmu(Path(name) / "cart.fmu", kind="CoSimulation")
        text = cart.RIG + cart.FMU.replace("FILE", "cart.fmu")
        for step in STEPS:
            own = text.replace('kind = "fmu"', f'kind = "fmu"\nstep = {step}')
            rig = rig_of_text(own, folder=path.parent)
            asked = simulate(compose(rig), GIVEN, record, np.zeros(4), accuracy=1e-8)["angle"]
            found = [asked] if step < 1e-4 else [asked, coupled(record, step)]
            errors = [f"{100 * np.max(np.abs(own - wanted)) / np.ptp(wanted):.2g}" for own in found]
            print(f"| {step:g} | {errors[0]} | {errors[1] if len(errors) > 1 else ''} |", flush=True)


if __name__ == "__main__":
    main()
