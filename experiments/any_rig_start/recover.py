"""Check that a fit from its own start values reaches the noise for arbitrary parameters of a rig.

A draw is a rig whose parameters lie log-uniformly over two decades, and two records of 12 s at 200 Hz with 0.5 % of noise: a
multisine and steps on every input, or, of a rig without inputs, two decays from random states.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import RigsightError
from rigsight.identify import GreyBoxFit, characteristic_scales, linear_start
from rigsight.records.record import Record
from rigsight.rigs import Rig, read_rig_file
from rigsight.simulate import compose, simulate

DT, N = 5e-3, 2400
T = DT * np.arange(N)
NOISE = 5e-3
REACHED = 1.05
HERE = Path(__file__).parent
BUILT_IN = HERE.parents[1] / "src" / "rigsight" / "rigs" / "files"
BAND = (0.3, 25.0)
LARGEST_ANGLE = 100.0

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """A rig, the middle of its parameters, its inputs' size, and the sensor that its second record lacks."""

    file: Path
    middle: Mapping[str, float]
    amplitude: float = 1.0
    lacks: str | None = None
    offset: str | None = None


CASES = {
    "drive_train": Case(BUILT_IN / "drive_train.toml", {
        "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}),
    "drive_train, second record without the load's angle": Case(BUILT_IN / "drive_train.toml", {
        "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}, lacks="load_angle"),
    "servo": Case(BUILT_IN / "servo.toml", {"J": 0.02, "k_v": 3.0, "d": 0.2, "angle_off": 0.2}, 0.5, offset="angle_off"),
    "cart_pendulum": Case(BUILT_IN / "cart_pendulum.toml", {
        "m_c": 0.5, "m_p": 0.2, "s": 0.04, "I_p": 0.012, "k_u": 2.0, "d_c": 3.0, "d_p": 0.002}, 2.0),
    "two_link_arm": Case(BUILT_IN / "two_link_arm.toml", {
        "I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02}, 0.5),
    "quarter_car": Case(BUILT_IN / "quarter_car.toml", {
        "m_w": 40.0, "k_b": 2e4, "d_b": 1500.0, "k_t": 2e5, "d_t": 50.0}, 0.02),
    "hydraulic_lift": Case(HERE / "hydraulic_lift.toml", {
        "m": 20.0, "k": 1e4, "d": 200.0, "capacity": 1e-10, "leak": 1e-9}, 1e-4),
    "gimbal": Case(HERE / "gimbal.toml", {
        "J_pan": 0.01, "J_tilt": 0.004, "J_camera": 0.006, "k_pan": 0.5, "k_tilt": 0.5, "d_pan": 0.02, "d_tilt": 0.02}),
    "double_pendulum": Case(HERE / "double_pendulum.toml", {
        "I_1": 0.02, "s_1": 0.06, "I_2": 0.01, "s_2": 0.05, "d_1": 0.01, "d_2": 0.005}),
}  # fmt: skip


def multisine(amplitude: float, rng: np.random.Generator) -> Floats:
    omega = 2.0 * np.pi * np.arange(1, 200) / T[-1]
    lines = omega[(omega > BAND[0]) & (omega < BAND[1])]
    u = np.sum(np.sin(np.outer(T, lines) + rng.uniform(0.0, 2.0 * np.pi, lines.size)), axis=1)
    return np.asarray(amplitude * u / np.std(u))


def steps(amplitude: float, rng: np.random.Generator) -> Floats:
    edges = np.cumsum(rng.integers(60, 240, 40))
    return np.asarray(amplitude * rng.uniform(-1.5, 1.5, 41)[np.searchsorted(edges, np.arange(N))])


def drawn(
    case: Case, rig: Rig, rng: np.random.Generator
) -> tuple[dict[str, float], list[Record], dict[str, float]]:
    """Return true parameters, records and the noise of each sensor; a rig that flies off is drawn again."""
    structure = compose(rig)
    while True:
        truth = {name: middle * 10.0 ** rng.uniform(-1.0, 1.0) for name, middle in case.middle.items()}
        if case.offset is not None:
            truth[case.offset] = rng.uniform(-1.0, 1.0) * case.middle[case.offset]
        clean = []
        try:
            for kind in (multisine, steps):
                inputs = {s.name: kind(case.amplitude, rng) for s in rig.inputs} or {"unread": np.zeros(N)}
                state = None if rig.inputs else rng.uniform(-1.2, 1.2, len(structure.states))
                clean.append(simulate(structure, truth, Record(kind.__name__, DT, inputs, {}), state))
        except RigsightError:
            continue
        names = [s.name for s in rig.outputs]
        if max(np.max(np.abs(record[name])) for record in clean for name in names) < LARGEST_ANGLE:
            break
    noise = {name: NOISE * max(float(np.std(record[name])) for record in clean) for name in names}
    records = [
        r.with_signals(**{name: r[name] + size * rng.standard_normal(N) for name, size in noise.items()})
        for r in clean
    ]
    if case.lacks is not None:
        kept = {name: samples for name, samples in records[1].signals.items() if name != case.lacks}
        records[1] = Record("lacking", DT, kept, {})
    return truth, records, noise


def sensitive(rig: Rig, records: list[Record], truth: Mapping[str, float]) -> bool:
    """Return True if an initial state that is beside by a thousandth of what one sample tells changes the end of a record."""
    structure = compose(rig)
    for record in records:
        begin = 0.3 * np.ones(len(structure.states))
        one, other = (
            simulate(structure, truth, record, s, 1e-9) for s in (begin, begin * (1.0 + 1e-3 * NOISE))
        )
        for name in (s.name for s in rig.outputs):
            if np.max(np.abs(one[name] - other[name])) > 0.1 * np.std(one[name]):
                return True
    return False


def determined(
    rig: Rig, records: list[Record], truth: Mapping[str, float], noise: Mapping[str, float]
) -> bool:
    """Return True if no parameter, nor the scale of all, is free: the Fisher matrix at the truth has full rank."""
    free = [p.name for p in rig.parameters]
    constants = {c.name: float(c.default or 0.0) for c in rig.constants}
    values = {**constants, **truth}
    fit = GreyBoxFit(compose(rig), records, characteristic_scales(rig, records, values), noise)
    return bool(np.linalg.eigvalsh(fit.information(values, free))[0] > 1.0)


def main(names: list[str], count: int, first: int) -> None:
    for name in names:
        case = CASES[name]
        rig = read_rig_file(case.file)
        constants = {c.name: c.default for c in rig.constants if c.default is not None}
        reached, seconds, free, calm, reached_calm = 0, [], 0, 0, 0
        for seed in range(first, first + count):
            truth, records, noise = drawn(case, rig, np.random.default_rng([seed, 20]))
            begin = time.process_time()
            start = {**constants, **linear_start(rig, records, constants, {})}
            started = time.process_time()
            scales = characteristic_scales(rig, records, start)
            fit = GreyBoxFit(compose(rig), records, scales, noise).fit(
                start, [p.name for p in rig.parameters]
            )
            seconds.append(time.process_time() - begin)
            good = fit.weighted_rms <= REACHED
            reached += good
            free += not determined(rig, records, truth, noise)
            chaotic = sensitive(rig, records, {**constants, **truth})
            calm += not chaotic
            reached_calm += good and not chaotic
            told = f"  {seed}: {fit.weighted_rms:.3f} noise floors, start {started - begin:.1f} s, all {seconds[-1]:.1f} s"
            told += ", chaotic" if chaotic else ""
            told += "" if good else "  " + ", ".join(f"{k} x{fit.values[k] / truth[k]:.3g}" for k in truth)
            print(told, flush=True)
        print(
            f"| {name} | {reached} of {count} | {free} | {np.median(seconds):.1f} s | {max(seconds):.1f} s |",
            flush=True,
        )


if __name__ == "__main__":
    chosen = sys.argv[1].split(";") if len(sys.argv) > 1 and sys.argv[1] != "all" else list(CASES)
    main(chosen, int(sys.argv[2]) if len(sys.argv) > 2 else 20, int(sys.argv[3]) if len(sys.argv) > 3 else 1)
