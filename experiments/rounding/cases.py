"""The diagnoses that are repeated: hysteresis by sliders, recovery on an axis, trials of the standard blind bench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.excitation import linear_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight_bench.trials import draw_trial

DT, NOISE = 0.01, 2e-5
RIG = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
_SLIDERS = (
    ("nearly all memory", {"k": 2500.0, "a": 0.03, "x_s": 0.002, "q": -0.4}),
    ("sliders of any size", {"k": 180.0, "a": 0.55, "x_s": 0.008, "q": -0.7}),
    ("large sliders", {"k": 150.0, "a": 0.75, "x_s": 0.006, "q": 0.5}),
)
_OTHERS = (
    ("cubic_stiffness", {"k_3": 4e5}),
    ("coulomb_friction", {"T_c": 0.02}),
    ("actuator_lag", {"T_a": 0.01}),
)
_SIZES = (("low", "estimation", 0.3), ("high", "estimation", 1.0), ("middle", "validation", 0.6))


@dataclass(frozen=True)
class Case:
    """Records, what may be missing, and the noise in them."""

    name: str
    campaign: Campaign
    effects: tuple[Effect, ...]
    noise: float

    def disturbed(self, share: float, seed: int) -> Campaign:
        """Return the campaign with that share of the noise added to what was measured; seed 0 adds nothing."""
        if seed == 0:
            return self.campaign
        rng = np.random.default_rng(seed)
        records = []
        for record in self.campaign.records:
            own = [signal.name for signal in self.campaign.rig.outputs if signal.name in record]
            moved = {n: record[n] + rng.normal(scale=share * self.noise, size=record.n_samples) for n in own}
            records.append(record.with_signals(**moved))
        return replace(self.campaign, records=tuple(records))


def cases(draws: int, trials: tuple[int, ...]) -> list[Case]:
    """Return the cases: the sliders with as many draws of noise, the others, and numbered trials of seed 9."""
    found = []
    for name, own in _SLIDERS:
        for draw in range(draws):
            found.append(_axis(f"{name}, draw {draw}", "iwan_hysteresis", own, draw, ("iwan_hysteresis",)))
    rivals = tuple(name for name, _ in _OTHERS)
    found += [_axis(name, name, own, 0, rivals) for name, own in _OTHERS]
    for number in trials:
        trial = draw_trial("standard", 9, number)
        rig = trial.rig
        constants = {p.name: trial.values[p.name] for p in rig.constants}
        campaign = Campaign(f"trial {number}", rig, constants, trial.given, trial.records)
        noise = min(float(value) for value in trial.key["noise_floor"].values())
        found.append(Case(f"standard 9, trial {number}", campaign, CATALOGUE, noise))
    return found


def _axis(name: str, effect: str, own: Mapping[str, float], draw: int, tried: tuple[str, ...]) -> Case:
    structure, rng = compose(AXIS, [effect_named(effect)]), np.random.default_rng(draw)
    t = DT * np.arange(2000)
    records = []
    for run, role, size in _SIZES:
        asked = Record(run, DT, {"u": linear_sweep(t, size, 1.0, 30.0)}, {}, role=role, hold="zoh")
        clean = simulate(structure, {**RIG, **own}, asked)
        records.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size)))
    campaign = Campaign(name, AXIS, {"gain": 1.0}, {}, tuple(records))
    return Case(name, campaign, tuple(effect_named(n) for n in tried), NOISE)
