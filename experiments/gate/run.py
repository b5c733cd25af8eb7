"""How many drifted records does a gate catch, and how many true ones does it refuse?

    python experiments/gate/run.py --seed 700

Twenty campaigns of four rigs, drawn anew: five records with colored disturbance and noise, to three of which the model is fitted.
Each then meets five further true records and five of a drifted rig, one at a time. Writes results.md beside this file.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.signal import butter, sosfilt

from rigsight.compare.own_numbers import place_of
from rigsight.effects import Effect, effect_named, placed
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose, simulate
from rigsight.simulate.model import Model
from rigsight.workflow.gate import gate_of
from rigsight.workflow.gating import Limits, of_records

HERE = Path(__file__).parent
CAMPAIGNS_EACH, RECORDS_EACH = 5, 5
KINDS = ("parameter 10 to 30 %", "friction 5 to 20 % of the drive", "sensor gain 3 to 10 %")


@dataclass(frozen=True)
class Plant:
    """A rig with its numbers, and how it is driven."""

    rig: str
    effects: tuple[str, ...]
    values: Mapping[str, float]
    held: frozenset[str]  # parameters that no record can tell from others
    amplitude: Mapping[str, float]  # of each input, in its unit
    band: tuple[float, float]  # of the excitation [rad/s]
    dt: float
    force_per_input: float

    def structure(self, *more: Effect) -> Structure:
        """Return its equations."""
        return compose(RIGS[self.rig], (*map(effect_named, self.effects), *more))


PLANTS = (
    Plant(
        "axis", ("cubic_stiffness",),
        {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0, "k_3": 5e6},
        frozenset({"force_off"}), {"u": 4.0}, (3.0, 60.0), 5e-3, 1.0,
    ),
    Plant(
        "running_gear", (),
        {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 0.0016, "l_0": 0.25,
         "c_y": 0.983, "y_off": 1.9e-4},
        frozenset(), {"u": 0.8}, (1.0, 40.0), 5e-3, 0.81,
    ),
    Plant(
        "drive_train", (),
        {"k_t": 0.05, "J_m": 1e-3, "J_l": 2e-3, "k_s": 20.0, "d_s": 0.02, "d_m": 5e-3, "d_l": 5e-3, "k_l": 2.0},
        frozenset(), {"u": 2.0}, (3.0, 220.0), 2e-3, 0.05,
    ),
    Plant(
        "two_link_arm", (),
        {"l_1": 0.3, "g": 9.81, "I_1": 0.04, "I_2": 0.02, "m_2": 1.0, "s_1": 0.2, "s_2": 0.12, "d_1": 0.2, "d_2": 0.05},
        frozenset({"m_2"}), {"tau_1": 1.0, "tau_2": 0.3}, (1.0, 25.0), 5e-3, 1.0,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Bench:
    """A plant with its disturbance and noise, the same for all records of a campaign."""

    plant: Plant
    disturbance: float  # RMS, as a share of the amplitude of each input
    corner: float  # of its spectrum [rad/s]
    noise: Mapping[str, float]  # of each sensor

    def record(
        self,
        name: str,
        rng: np.random.Generator,
        structure: Structure,
        values: Mapping[str, float],
        gains: Mapping[str, float] | None = None,
    ) -> Record:
        """Return what is measured of a plant that may have changed."""
        driven = excited(self.plant, name, rng)
        pushed = {
            u: driven[u] + disturbance(self.disturbance * a, self.corner * driven.dt, driven.n_samples, rng)
            for u, a in self.plant.amplitude.items()
        }
        moved = simulate(structure, values, driven.with_signals(**pushed))
        read = {
            sensor: (gains or {}).get(sensor, 1.0) * moved[sensor] + rng.normal(0.0, std, driven.n_samples)
            for sensor, std in self.noise.items()
        }
        return driven.with_signals(**read)


def excited(plant: Plant, name: str, rng: np.random.Generator) -> Record:
    """Return the inputs of a record: a sweep or a multisine of random phases after rest, at 0.6 to 1 of the amplitude."""
    t = plant.dt * np.arange(3000)
    start, stop = plant.band
    size, is_sweep = rng.uniform(0.6, 1.0), rng.random() < 0.5
    signals = {}
    for u, amplitude in plant.amplitude.items():
        if is_sweep:
            moving = linear_sweep(t[300:], size * amplitude, start, stop) * rng.choice([-1.0, 1.0])
        else:
            omega = np.linspace(start, stop, 40)
            phases = rng.uniform(0.0, 2.0 * np.pi, omega.size)
            moving = np.sin(np.outer(t[300:], omega) + phases).sum(axis=1)
            moving *= size * amplitude / (math.sqrt(2.0) * np.std(moving))
        signals[u] = np.concatenate([np.zeros(300), moving])
    units = dict(RIGS[plant.rig].signal_units)
    return Record(name, dt=plant.dt, signals=signals, units=units)


def disturbance(size: float, corner: float, n_samples: int, rng: np.random.Generator) -> np.ndarray:
    """Return colored noise of an RMS; its corner is in radians per sample."""
    low_pass = butter(1, min(0.9, corner / np.pi), output="sos")
    noise = sosfilt(low_pass, rng.normal(size=n_samples + 1000))
    return np.asarray(size * (noise / np.std(noise))[1000:])


def bench_of(plant: Plant, rng: np.random.Generator) -> Bench:
    """Return a plant with drawn disturbance and noise."""
    calm = simulate(plant.structure(), plant.values, excited(plant, "calm", rng))
    noise = {
        s.name: float(np.std(calm[s.name])) * log_uniform(rng, 0.002, 0.01) for s in RIGS[plant.rig].outputs
    }
    return Bench(plant, log_uniform(rng, 0.005, 0.05), log_uniform(rng, *plant.band), noise)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def fitted(plant: Plant, records: Sequence[Record], noise: Mapping[str, float]) -> Model:
    """Return the model that fits records: how fits find their start is not studied here."""
    structure = plant.structure()
    constants = {p.name for p in structure.rig.constants}
    free = [name for name in structure.names if name not in constants | plant.held]
    scales = characteristic_scales(structure.rig, records, plant.values)
    found = GreyBoxFit(structure, records, scales, noise).fit(plant.values, free)
    return Model.of(structure, found.values, "foh")


@dataclass(frozen=True)
class Row:
    """What became of one record."""

    rig: str
    kind: str  # one of `KINDS`, or empty for a true record
    what: str
    closed: bool
    excess: float  # the largest of gaps and changed numbers in units of their limits
    place: bool  # whether the place of the change was named
    seconds: float


def drifted(bench: Bench, kind: str, rng: np.random.Generator) -> tuple[Record, str, str]:
    """Return a record of a changed plant, what was changed, and where."""
    plant, structure, values = bench.plant, bench.plant.structure(), dict(bench.plant.values)
    if kind == KINDS[0]:
        constants = {p.name for p in structure.rig.constants}
        name = str(
            rng.choice([n for n, v in values.items() if n not in constants and v != 0.0 and "off" not in n])
        )
        change = rng.uniform(0.1, 0.3) * rng.choice([-1.0, 1.0])
        values[name] *= 1.0 + change
        return bench.record("new", rng, structure, values), f"{name} {change:+.0%}", place_of(structure, name)
    if kind == KINDS[1]:
        joint = str(rng.choice([j.name for j in structure.rig.mechanism.joints]))
        share = rng.uniform(0.05, 0.2)
        friction = effect_named("coulomb_friction")
        one = structure.rig.has_one_motion
        worn = plant.structure(friction if one else placed(friction, joint))
        added = [n for n in worn.names if n not in values]
        # Half of the amplitude is the RMS, roughly, of what drives the rig.
        values |= dict.fromkeys(
            added, share * plant.force_per_input * max(plant.amplitude.values()) / math.sqrt(2.0)
        )
        return bench.record("new", rng, worn, values), f"friction {share:.0%} at {joint}", joint
    sensor = str(rng.choice(list(bench.noise)))
    change = rng.uniform(0.03, 0.1) * rng.choice([-1.0, 1.0])
    record = bench.record("new", rng, structure, values, {sensor: 1.0 + change})
    return record, f"gain of {sensor} {change:+.1%}", sensor


def rows_of(plant: Plant, seed: int) -> Iterator[Row]:
    """Yield what becomes of the records of one campaign."""
    rng = np.random.default_rng([seed, *plant.rig.encode()])
    bench = bench_of(plant, rng)
    known = [bench.record(f"known {i}", rng, plant.structure(), plant.values) for i in range(5)]
    model = fitted(plant, known[:3], bench.noise)
    reference = of_records(model, known, are_known=True)
    kinds = [KINDS[(seed + i) % len(KINDS)] for i in range(RECORDS_EACH)]
    for kind in ("",) * RECORDS_EACH + tuple(kinds):
        if kind:
            record, what, where = drifted(bench, kind, rng)
        else:
            record, what, where = bench.record("new", rng, plant.structure(), plant.values), "", ""
        begun = time.process_time()
        gate = gate_of(model, [replace(record, role="validation")], reference, Limits())
        excess = max((check.excess for check in (*gate.checks, *gate.numbers)), default=math.inf)
        yield Row(
            plant.rig, kind, what, gate.closed, excess, gate.place == where, time.process_time() - begun
        )


def main() -> None:
    """Draw the records and write the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=700)
    parser.add_argument("--campaigns", type=int, default=CAMPAIGNS_EACH)
    asked = parser.parse_args()
    rows = [row for plant in PLANTS for i in range(asked.campaigns) for row in rows_of(plant, asked.seed + i)]
    (HERE / "results.md").write_text(tables(rows, asked.seed), encoding="utf-8")


def tables(rows: Sequence[Row], seed: int) -> str:
    """Return the tables as Markdown."""
    true, changed = [r for r in rows if not r.kind], [r for r in rows if r.kind]
    lines = [
        f"Seed {seed}. True records refused: {share(true)}. Drifted records caught: {share(changed)}. "
        f"Longest gate: {max(r.seconds for r in rows):.1f} s of processor time.",
        "",
        "| rig | true records refused | drifted records caught |",
        "|---|---|---|",
        *(
            f"| {plant.rig} | {share([r for r in true if r.rig == plant.rig])} "
            f"| {share([r for r in changed if r.rig == plant.rig])} |"
            for plant in PLANTS
        ),
        "",
        "| drift | caught | place named, of those caught |",
        "|---|---|---|",
    ]
    for kind in KINDS:
        own = [r for r in changed if r.kind == kind]
        caught = [r for r in own if r.closed]
        lines.append(f"| {kind} | {share(own)} | {sum(r.place for r in caught)} of {len(caught)} |")
    lines += ["", "| missed | rig | farthest, in limits |", "|---|---|---|"]
    missed = sorted((r for r in changed if not r.closed), key=lambda r: r.excess)
    lines += [f"| {r.what} | {r.rig} | {r.excess:.2f} |" for r in missed]
    return "\n".join(lines) + "\n"


def share(rows: Sequence[Row]) -> str:
    """Return how many were closed."""
    return f"{sum(r.closed for r in rows)} of {len(rows)}"


if __name__ == "__main__":
    main()
