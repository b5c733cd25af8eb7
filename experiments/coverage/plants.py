"""The plants of the coverage study: a rig with one effect, external forces at its joints, and noisy sensors.

The plant is the accurate integrator, at a quarter of the records' sample time and with forces that a bootstrap does not draw:
each joint has one with a corner frequency of its own, which bends between the samples.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.pushes.probes import push
from rigsight.diagnose.replicates import with_forces
from rigsight.effects import Effect
from rigsight.errors import SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Hold, Kind, Record
from rigsight.records.signals import typical_size
from rigsight.rigs import Rig
from rigsight.simulate import compose, simulate
from rigsight_bench.trials.any_rig_campaign import (
    DURATION,
    doublets,
    draw_amplitudes,
    in_proportion,
    multisines,
    sweeps,
)
from rigsight_bench.trials.any_rig_numbers import draw_numbers, draw_offsets
from rigsight_bench.trials.runs import DT, Run
from rigsight_bench.trials.strength import draw_shape, scaled, sized
from rigsight_bench.trials.waveforms import Disturbance, low_pass_noise

Floats = NDArray[np.float64]

FINER = 4
NOISE = (3e-4, 3e-3)
"""Sensor noise in units of the reading."""
GAP = (5.0, 60.0)
"""What the equations without the effect leave, in units of the noise."""
DISTURBED = (0.3, 3.0)
"""What the forces leave, in units of the noise of the sensor that shows them most."""
CORNERS = (0.5, 50.0)
"""Angular frequency above which a force falls [rad/s]."""
_ATTEMPTS = 8
_RECORDS: tuple[tuple[Kind, float], ...] = (
    ("sweep", 0.4), ("sweep", 1.0), ("step", 0.6), ("multisine", 0.8),
    ("multisine", 0.7), ("sweep", 0.75), ("multisine", 0.65), ("step", 0.85),
)  # fmt: skip
"""Kind and share of the largest amplitude. Only the first four are measured; the others keep the later draws as they were."""


@dataclass(frozen=True)
class Drawn:
    """A plant with its records."""

    bench: FitContext
    effects: tuple[Effect, ...]
    values: dict[str, float]
    gap: float
    disturbed: float


def drawn(rig: Rig, effect: Effect, key: tuple[int, ...]) -> Drawn:
    """Draw a plant and measure it; everything follows from the key."""
    reason: SimulationError | None = None
    for attempt in range(_ATTEMPTS):
        try:
            return _drawn(rig, effect, np.random.default_rng([*key, attempt]))
        except SimulationError as error:
            reason = error
    raise SimulationError(f"{effect.name} cannot be drawn: {reason}")


def _drawn(rig: Rig, effect: Effect, rng: np.random.Generator) -> Drawn:
    values = draw_numbers(rig, rng)
    runs = _drawn_runs(rig, values, rng)
    quiet = [simulate(compose(rig), values, run.record()) for run in runs]
    values |= draw_offsets(rig, quiet, values, rng)
    if "force_off" in values and rig.has_one_motion:
        # A diagnosis holds it at zero: beside a spring it is a shifted rest position.
        values["force_off"] = 0.0
    quiet = [simulate(compose(rig), values, run.record()) for run in runs]
    scales = characteristic_scales(rig, quiet, values)
    share = _between(NOISE, rng)
    noise = {s.name: share * typical_size([r[s.name] for r in quiet]) for s in rig.outputs}
    structure = compose(rig, [effect])
    free = [p.name for p in rig.parameters if p.name != "force_off" or not rig.has_one_motion]

    def gap(own: dict[str, float]) -> float:
        named = {structure.parameter_name(effect, name): value for name, value in own.items()}
        shown = [simulate(structure, {**values, **named}, run.record()) for run in (runs[1], runs[3])]
        fit = GreyBoxFit(compose(rig), shown, scales, noise).fit(values, free, max_evaluations=15)
        if not fit.residuals:
            raise SimulationError("No linear equations come near this motion.")
        left = np.concatenate(fit.residuals) / [noise[s.name] for s in rig.outputs]
        return float(np.max(np.sqrt(np.mean(left**2, axis=0))))

    at = functools.partial(scaled, effect, draw_shape(effect, scales, rng), scales=scales)
    own = sized(effect.name, at, gap, _between(GAP, rng))
    values |= {structure.parameter_name(effect, name): value for name, value in own.values.items()}
    wanted = _between(DISTURBED, rng)
    records, floor, disturbed = _measured(rig, effect, values, runs, noise, scales, wanted, rng)
    bench = FitContext(
        rig=rig,
        estimation=records,
        scoring=records,
        look=records,
        scales=scales,
        noise=floor,
        held=frozenset(),
    )
    return Drawn(bench, (effect,), values, own.gap, disturbed)


def _drawn_runs(rig: Rig, values: dict[str, float], rng: np.random.Generator) -> list[Run]:
    amplitudes, band = draw_amplitudes(rig, values, rng)
    cannot_jump = any(c.prescribed_by in rig.mechanism.inputs for c in rig.mechanism.prescribed)
    runs = []
    for number, (wanted, share) in enumerate(_RECORDS, 1):
        kind: Kind = "multisine" if wanted == "step" and cannot_jump else wanted
        draw = {"sweep": sweeps, "multisine": multisines, "step": doublets}[kind]
        waves = in_proportion(draw(amplitudes, band, rng), share)
        hold: Hold = "zoh" if kind == "step" else "band_limited"
        runs.append(Run(f"record_{number}", "estimation", kind, hold, waves, round(DURATION / DT)))
    return runs[:4]


def _measured(
    rig: Rig,
    effect: Effect,
    values: dict[str, float],
    runs: list[Run],
    noise: dict[str, float],
    scales: dict[str, float],
    wanted: float,
    rng: np.random.Generator,
) -> tuple[tuple[Record, ...], dict[str, float], float]:
    """Return the records, what stands above nothing in each sensor, and what forces leave in units of the noise."""
    structure = compose(with_forces(rig), [effect])
    joints = [joint.name for joint in rig.mechanism.joints]
    unit = {
        joint: [(_between(CORNERS, rng), math.exp(rng.normal()), int(rng.integers(2**31))) for _ in runs]
        for joint in joints
    }

    def shown(index: int, size: float) -> dict[str, Floats]:
        record = runs[index].record(finer=FINER)
        t = record.dt * np.arange(record.n_samples)
        forces = {}
        for joint in joints:
            corner, own, seed = unit[joint][0][0], unit[joint][0][1], unit[joint][index][2]
            force = _force(own * scales[f"force@{joint}"], corner, seed)
            forces[push(joint)] = size * force.spline(t)
        pushed = replace(record, signals={**record.signals, **forces})
        out = simulate(structure, values, pushed, accuracy=1e-7)
        return {s.name: out[s.name][::FINER] for s in rig.outputs}

    calm = [shown(i, 0.0) for i in range(len(runs))]

    def passed(clean: list[dict[str, Floats]]) -> dict[str, float]:
        return {
            name: math.sqrt(
                float(
                    np.mean(
                        np.concatenate([a[name] - b[name] for a, b in zip(clean, calm, strict=True)]) ** 2
                    )
                )
            )
            for name in noise
        }

    size = 1e-4
    for _ in range(4):
        left = passed([shown(i, size) for i in range(len(runs))])
        most = max(left[name] / noise[name] for name in noise)
        size *= min(max(wanted / max(most, 1e-12), 1e-2), 1e2)
        if abs(math.log(max(most, 1e-12) / wanted)) < 0.2:
            break
    clean = [shown(i, size) for i in range(len(runs))]
    left = passed(clean)
    records = tuple(
        run.record({name: own[name] + rng.normal(scale=noise[name], size=own[name].size) for name in noise})
        for run, own in zip(runs, clean, strict=True)
    )
    floor = {name: math.hypot(noise[name], left[name]) for name in noise}
    return records, floor, max(left[name] / noise[name] for name in noise)


def _force(size: float, corner: float, seed: int) -> Disturbance:
    return low_pass_noise(size, corner, DURATION + 1.0, np.random.default_rng(seed), spacing=0.1 / corner)


def _between(ends: tuple[float, float], rng: np.random.Generator) -> float:
    return float(math.exp(rng.uniform(*np.log(ends))))
