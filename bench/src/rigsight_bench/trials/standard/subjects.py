"""Hidden effects of the trials of design ``standard``: a list of cells, shuffled so that a trial's number reveals nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np

from rigsight.effects import CATALOGUE, Effect, Place, effect_named
from rigsight_bench.trials.counted import counted_effects
from rigsight_bench.trials.kinds import TIERS, Kind, Tier
from rigsight_bench.trials.passes import shuffled
from rigsight_bench.trials.standard.outside import OUTSIDE

Noise = Literal["low", "high"]
ELSEWHERE = frozenset({
    "encoder_eccentricity", "load_dependent_friction", "maxwell_branch", "power_law_stiffness", "presliding_friction",
    "speed_limit", "time_shift", "torque_ripple", "directional_friction", "inertia",
})  # fmt: skip
"""Effects that are hidden in the other designs only: those of servo and robot joints, and two that neither rig has (friction that
differs each way is a rest position there, and the motion is not prescribed)."""
RELATED: frozenset[frozenset[str]] = frozenset({
    frozenset({"bouc_wen_hysteresis", "iwan_hysteresis"}), frozenset({"bouc_wen_hysteresis", "coulomb_friction"}),
    frozenset({"coulomb_friction", "stribeck_friction"}), frozenset({"cubic_stiffness", "gravity_pendulum"}),
    frozenset({"coulomb_friction", "load_dependent_friction"}), frozenset({"coulomb_friction", "presliding_friction"}),
    frozenset({"bouc_wen_hysteresis", "presliding_friction"}), frozenset({"iwan_hysteresis", "presliding_friction"}),
    frozenset({"cubic_stiffness", "power_law_stiffness"}), frozenset({"input_saturation", "speed_limit"}),
    frozenset({"input_delay", "time_shift"}),
})  # fmt: skip
"""Effects that are not hidden together, because one contains the other, or their readings are the same."""
NOISES: dict[Noise, float] = {"low": 5e-4, "high": 2e-3}
"""Sensor noise in units of the size of what the sensor shows."""
_PAIRS, _NONE, _PARAMETERS, _OUTSIDE = 40, 16, 16, 4
"""Trials of each kind besides three strengths at two noise levels of each single effect; from outside: of each effect."""


@dataclass(frozen=True)
class Subject:
    """The hidden effects of one trial.

    Attributes
    ----------
    kind
        A single effect of the catalogue, two of them, none, wrong parameters, or an effect from outside.
    effects
        Names; empty where there is none.
    tier
        Strength that is aimed for; None where there is no effect.
    noise
        Noise level.
    """

    kind: Kind
    effects: tuple[str, ...]
    tier: Tier | None
    noise: Noise


@cache
def standard_cells() -> tuple[Subject, ...]:
    """Return all cells of one pass; the effects of a pair are drawn with the trial."""
    tiers, noises = tuple(TIERS), tuple(NOISES)
    cells = [
        Subject("single", (effect.name,), tier, noise)
        for effect in _offered()
        for tier in tiers
        for noise in noises
    ]
    # Pairs are of clear effects: a faint effect next to another is no easier to find than a faint one alone.
    cells += [Subject("pair", (), tiers[1 + i % 2], noises[i // 2 % 2]) for i in range(_PAIRS)]
    cells += [Subject("none", (), None, noises[i % 2]) for i in range(_NONE)]
    cells += [Subject("parameters", (), None, noises[i % 2]) for i in range(_PARAMETERS)]
    cells += [
        Subject("outside", (effect.name,), tiers[i % 3], noises[(i + number) % 2])
        for number, effect in enumerate(OUTSIDE)
        for i in range(_OUTSIDE)
    ]
    return tuple(cells)


def standard_subject_of(seed: int, trial: int) -> Subject:
    """Return what a trial hides; every pass over the list of cells is shuffled anew."""
    cells = standard_cells()
    cell = shuffled(cells, trial, seed)
    if cell.kind == "pair":
        return replace(cell, effects=_pair(np.random.default_rng([seed, *divmod(trial, len(cells))])))
    return cell


def hidden_effects(subject: Subject) -> tuple[Effect, ...]:
    """Return the effects that a trial hides."""
    outside = {effect.name: effect for effect in OUTSIDE}
    return tuple(outside[name] if name in outside else effect_named(name) for name in subject.effects)


def _offered() -> tuple[Effect, ...]:
    return tuple(effect for effect in counted_effects() if effect.name not in ELSEWHERE)


def _pair(rng: np.random.Generator) -> tuple[str, ...]:
    """Draw two effects of which neither contains the other."""
    effects = _offered()
    while True:
        drawn = [effects[int(i)] for i in rng.choice(len(effects), 2, replace=False)]
        if _tells_apart(*drawn):
            return tuple(sorted(effect.name for effect in drawn))


def _tells_apart(first: Effect, second: Effect) -> bool:
    names = frozenset({first.name, second.name})
    # The weight's sine needs an axis that swings wide, the wheel and the second sensor a running gear.
    other_rig = "gravity_pendulum" in names and any(needs_running_gear(e) for e in (first, second))
    return not (names in RELATED or other_rig)


def needs_running_gear(effect: Effect) -> bool:
    """Return True if the effect is distinguishable only on a running gear.

    On a rig with one output, a sensor delay is the same as an input delay.
    """
    return effect.place in (Place.LATERAL_DYNAMICS, Place.SENSOR) and effect.name in {
        e.name for e in CATALOGUE
    }
