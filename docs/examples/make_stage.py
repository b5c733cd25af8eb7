"""Write the records that docs/first_diagnosis.md diagnoses: python docs/examples/make_stage.py FOLDER.

They stand for a positioning stage on dry guides, logged in milliseconds, millimeters and newtons.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import effect_named
from rigsight.excitation import log_sweep, multisine, multisine_lines
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT = 2e-3
REST = 2.0
LENGTH = 20.0
STAGE = {"gain": 1.0, "m": 2.1, "d": 12.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0, "T_c": 1.5}
NOISE = 2e-6


def measured(u: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    record = Record("stage", DT, {"u": u}, {"u": "N"}, hold="zoh")
    x = simulate(compose(AXIS, [effect_named("coulomb_friction")]), STAGE, record)["x"]
    return x + rng.normal(scale=NOISE, size=x.size)


def main(folder: Path) -> None:
    rng = np.random.default_rng(1)
    t = DT * np.arange(round(LENGTH / DT))
    rest = np.zeros(round(REST / DT))
    band = 2.0 * np.pi * np.array([0.5, 15.0])
    drives = {f"sweep_{a}N": log_sweep(t, float(a), *band) for a in (5, 10, 20)}
    lines = multisine_lines(t.size, DT, *band)
    drives["multisine_7N"] = multisine(t.size, DT, lines, effective=7.0, rng=rng).samples
    folder.mkdir(parents=True, exist_ok=True)
    for name, drive in drives.items():
        u = np.concatenate([rest, drive])
        x = measured(u, rng)
        rows = np.column_stack([1e3 * DT * np.arange(u.size), u, 1e3 * x])
        np.savetxt(
            folder / f"{name}.csv", rows, "%.7g", ",", header="time_ms,force_N,position_mm", comments=""
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
