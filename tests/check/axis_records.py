"""Records of an axis whose motion, noise and faults are known."""

from __future__ import annotations

import numpy as np

from rigsight.campaign import Campaign
from rigsight.effects import effect_named
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 2.0, "d": 12.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
NOISE = 2e-5
DT = 0.005


def swept(amplitude: float = 10.0, mean: float = 0.0, n: int = 3000) -> Floats:
    """Return a sweep through the resonance of the axis."""
    t = DT * np.arange(n)
    return mean + amplitude * np.sin(2.0 * np.pi * (0.3 * t + 0.15 * t**2))


def campaign(*inputs: Floats, effect: str = "", **numbers: float) -> Campaign:
    """Return a campaign with one estimation record for each input."""
    rng = np.random.default_rng(0)
    effects = [effect_named(effect)] if effect else []
    structure, records = compose(AXIS, effects), []
    for i, u in enumerate(inputs or (swept(),)):
        run = simulate(structure, {**VALUES, **numbers}, Record(f"run {i}", DT, {"u": u}, {}))
        records.append(run.with_signals(x=run["x"] + NOISE * rng.standard_normal(u.size)))
    given = {name: value for name, value in VALUES.items() if name != "gain"}
    return Campaign("axis", AXIS, {"gain": 1.0}, given, tuple(records))
