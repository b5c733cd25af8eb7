"""Friction laws of rigsight's catalogue fitted to the same logs by its own fit, from starts that are drawn."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from logs import DUTY, VOLTS, Log, divided, file_of

import rigsight as rs
from rigsight.effects import effect_named
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records.record import Record
from rigsight.simulate import Structure, compose

RIG = rs.Rig.from_file(Path(__file__).parent / "xl330.toml")
EFFECTS = (
    "coulomb_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "load_dependent_stribeck_friction",
    "back_driving_friction",
)
# Between which numbers starts are drawn, evenly in their logarithms: a decade or so around those of small servos.
DRAWN = {
    "J": (3e-4, 1e-2),
    "k_t": (0.1, 1.0),
    "R": (1.0, 10.0),
    "d": (1e-3, 3e-2),
    "T_c": (3e-3, 0.1),
    "T_s": (3e-3, 0.2),
    "mu": (0.03, 0.5),
    "mu_m": (0.03, 0.5),
    "mu_e": (0.03, 0.5),
    "s": (0.1, 1.0),
    "w_s": (0.1, 3.0),
}
STARTS, FOLLOWED, SEED = 200, 5, 0
NOISE = 1e-3  # rad; half a step of the encoder. One sensor: it scales the cost and moves nothing.


def records_of(folder: Path, logs: Sequence[Log]) -> list[Record]:
    return [
        rs.read_record(folder / file_of(log), RIG, hold="zoh", constants={"k_p": log[0] * DUTY})
        for log in logs
    ]


def errors(structure: Structure, values: Mapping[str, float], records: Sequence[Record]) -> list[float]:
    """Return the mean absolute error of each record, in rad, from rest."""
    model = rs.make_model(RIG, values, effects=[effect.name for effect in structure.effects])
    return [
        float(np.mean(np.abs(rs.simulate_model(model, record)["angle"] - record["angle"])))
        for record in records
    ]


def fitted(structure: Structure, records: Sequence[Record]) -> dict[str, float]:
    """Return the numbers of the free run with the least squares, from the best of drawn starts."""
    rng = np.random.default_rng(SEED)
    constants = {p.name: float(p.default) for p in RIG.constants if p.default is not None}
    constants["volts"] = VOLTS
    free = [name for name in structure.names if name not in constants]
    starts = [
        {name: float(np.exp(rng.uniform(*np.log(DRAWN[name])))) if name in DRAWN else 0.0 for name in free}
        for _ in range(STARTS)
    ]
    starts.sort(key=lambda start: float(np.mean(errors(structure, start, records))))
    searched = [replace(record, starting_samples=20) for record in records]
    found = []
    for start in starts[:FOLLOWED]:
        begin = {**constants, **start}
        scales = characteristic_scales(RIG, searched, begin)
        found.append(GreyBoxFit(structure, searched, scales, {"angle": NOISE}).fit(begin, free))
    best = min(found, key=lambda fit: fit.cost)
    return {name: best.values[name] for name in free}


def rows_of(folder: Path, split: str) -> list[dict[str, Any]]:
    """Return a row for each law, as `of_bam.py` prints them."""
    fit, held = (records_of(folder, logs) for logs in divided(split))
    rows = []
    for name in EFFECTS:
        structure = compose(RIG, [effect_named(f"{name}@gearbox")])
        errors(structure, dict.fromkeys(structure.names, 0.1), fit[:1])  # compiles its kernels
        began = time.process_time()
        numbers = fitted(structure, fit)
        seconds = time.process_time() - began
        rows.append(
            {
                "model": name,
                "numbers": numbers,
                "fitted": errors(structure, numbers, fit),
                "held_out": errors(structure, numbers, held),
                "seconds": seconds,
            }
        )
    return rows
