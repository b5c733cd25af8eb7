"""Models and records for the accuracy of the engine: every effect of the catalogue over its search box."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rigsight.effects import CATALOGUE, Effect
from rigsight.excitation import linear_sweep, log_sweep
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import Structure, compose
from rigsight.units import characteristic_value
from rigsight.workflow.own.effect_checks import bench_of, sizes

DT = 5e-3
N_SAMPLES = 200
_WIDE = 1e3
"""Longest ratio of a search box that is drawn evenly; longer ones are drawn by their logarithm."""


@dataclass(frozen=True)
class Draw:
    """A model with numbers, and the record that drives it."""

    name: str
    structure: Structure
    values: dict[str, float]
    record: Record


def record_for(rng: np.random.Generator, omega: float, hold: str, driven: str) -> Record:
    """Return a random input of that name around the rig's angular frequency [rad/s]: a sweep, a sum of sines or a staircase."""
    dt = float(rng.uniform(0.02, 0.12)) / omega
    t = dt * np.arange(N_SAMPLES)
    kind = rng.integers(3)
    first, last = omega * rng.uniform(0.05, 0.5), omega * rng.uniform(1.5, 6.0)
    if kind == 0:
        u = log_sweep(t, 1.0, first, last)
    elif kind == 1:
        u = linear_sweep(t, 1.0, first, last)
    else:
        frequencies = rng.uniform(first, last, 4)
        u = sum(np.sin(w * t + rng.uniform(0.0, 6.3)) for w in frequencies) / 2.0
        u = u - u[0]
    return Record("draw", dt, {driven: np.asarray(u)}, {driven: "input"}, hold=hold)


def draws(effect: Effect, count: int, seed: int) -> Iterator[Draw]:
    """Yield models of one effect at random places of its search box.

    Parameters
    ----------
    effect
        From the catalogue.
    count
        How many.
    seed
        Of all that is drawn.
    """
    rng = np.random.default_rng([seed, CATALOGUE.index(effect)])
    bench = bench_of(effect)
    rig: Rig = bench.rig
    structure = compose(rig, [effect])
    while count:
        values = dict(bench.values)
        for name in ("m", "d", "k", "J_z", "k_c", "k_d"):
            if name in values:
                values[name] *= float(np.exp(rng.uniform(-1.0, 1.0)))
        omega = _frequency(values)
        record = record_for(rng, omega, ("foh", "zoh")[int(rng.integers(2))], rig.inputs[0].name)
        scales = sizes(type(bench)(rig, values, bench.output, values, bench.free), record)
        own = {p.name: _drawn(rng, p) * characteristic_value(p.dimension, scales) for p in effect.parameters}
        own |= {p.name: p.default or 0.0 for p in effect.parameters if not p.fitted}
        sums = [
            (own[pair.first] + own[pair.second], own[pair.first] - own[pair.second])
            for pair in effect.searched_as
        ]
        if any(min(both) < 0.0 for both in sums):
            continue
        count -= 1
        named = {structure.parameter_name(effect, key): value for key, value in own.items()}
        yield Draw(effect.name, structure, {**values, **named}, record)


def _frequency(values: dict[str, float]) -> float:
    """Return the angular frequency of a rig's own motion [rad/s]; a motion that is prescribed has none, and 1 rad/s does."""
    for inertia, stiffness in (("m", "k"), ("J_z", "k_c")):
        if inertia in values:
            return float(np.sqrt(values[stiffness] / values[inertia]))
    return 1.0


def _drawn(rng: np.random.Generator, p) -> float:
    low, high = p.search
    if not (np.isfinite(low) and np.isfinite(high)):
        return 1.0
    if p.logarithmic or (low > 0.0 and high / low > _WIDE):
        return float(np.exp(rng.uniform(np.log(max(low, 1e-9)), np.log(high))))
    if rng.uniform() < 0.5:
        # Small values are where an effect is met; half of the draws reach down to a thousandth of the box.
        side = high if high > 0.0 else low
        return float(np.clip(side * 10.0 ** rng.uniform(-3.0, 0.0), low, high))
    return float(rng.uniform(low, high))
