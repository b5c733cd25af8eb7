"""A campaign as a measurement would leave it, from a rig whose numbers the tests know."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep, step
from rigsight.identify.transfer.conicity import creep_factor
from rigsight.records import Kind, Record, Role
from rigsight.rigs import RUNNING_GEAR, Rig
from rigsight.simulate import compose, simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
TRUTH = {
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": creep_factor(0.024, 0.1, 0.3), "y_off": -5e-4,
}  # fmt: skip
NOISE = 2e-5
DT = 5e-3


@dataclass(frozen=True)
class Run:
    """One record of a virtual campaign."""

    name: str
    u: np.ndarray
    kind: Kind = "sweep"
    role: Role = "estimation"
    amplitude: float | None = None


def sweep(name: str, amplitude: float, role: Role = "estimation", seconds: float = 25.0) -> Run:
    t = DT * np.arange(round(seconds / DT))
    return Run(name, log_sweep(t, amplitude, 0.6, 60.0), "sweep", role, amplitude)


def jump(name: str, amplitude: float) -> Run:
    return Run(name, step(DT * np.arange(1600), amplitude, 1.0), "step", "estimation", amplitude)


def write_campaign(
    folder: Path,
    runs: list[Run],
    rig: Rig = RUNNING_GEAR,
    values: Mapping[str, float] = {**CONSTANTS, **TRUTH},
    parameters: str = "",
    effect: str | None = None,
    change: Callable[[str, dict[str, np.ndarray]], None] | None = None,
    seed: int = 3,
) -> Path:
    """Measure a virtual rig and leave the campaign as a measurement would."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    structure = compose(rig, [effect_named(effect)] if effect else [])
    constants = "\n".join(f"{c.name} = {values[c.name]!r}" for c in rig.constants)
    toml = f'title = "bench"\n[rig]\nmodel = "{rig.name}"\n[rig.constants]\n{constants}\n[rig.parameters]\n{parameters}\n'
    source = rig.inputs[0].name
    for run in runs:
        record = Record(name=run.name, dt=DT, signals={source: run.u}, units={}, hold="foh")
        clean = simulate(structure, values, record)
        signals = {name: np.array(samples) for name, samples in clean.signals.items()}
        for signal in rig.outputs:
            signals[signal.name] += rng.normal(scale=NOISE, size=run.u.size)
        if change is not None:
            change(run.name, signals)
        rows = np.column_stack([record.t, *signals.values()])
        lines = [",".join(("t", *signals)), *(",".join(f"{value:.9g}" for value in row) for row in rows)]
        (folder / f"{run.name}.csv").write_text("\n".join(lines) + "\n")
        amplitude = "" if run.amplitude is None else f"amplitude = {run.amplitude}\n"
        toml += f'[[records]]\nfile = "{run.name}.csv"\nrole = "{run.role}"\nkind = "{run.kind}"\nhold = "foh"\n{amplitude}'
    (folder / "campaign.toml").write_text(toml)
    return folder
