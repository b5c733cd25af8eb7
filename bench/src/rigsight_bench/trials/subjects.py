"""The hidden effects of trials: a fixed list of cells, shuffled by the seed, so that a trial's number reveals nothing."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from rigsight.effects import CATALOGUE, Effect, Place, effect_named
from rigsight.errors import check_option
from rigsight_bench.trials.counted import RELATED, counted_effects
from rigsight_bench.trials.outside import OUTSIDE

Kind = Literal["single", "pair", "triple", "none", "parameters", "outside"]
SEVERAL = "several"
"""Kind of a trial with more effects than a verdict names; the first of its key is the main one, which leaves the largest gap."""
Tier = Literal["faint", "clear", "strong"]
Noise = Literal["low", "high"]
CatalogueDesign = Literal["small", "standard", "joints", "several"]
"""Lists of cells on the running gear or an axis; together they contain every counted effect that is distinguishable there."""

OF_JOINTS = frozenset({
    "encoder_eccentricity", "load_dependent_friction", "maxwell_branch", "power_law_stiffness", "presliding_friction",
    "speed_limit", "time_shift", "torque_ripple",
})  # fmt: skip
"""Effects of servo and robot joints, which were added to the catalogue later.

They have a design of their own, so that the trials of the two older designs stay unchanged.
"""
ELSEWHERE = frozenset({"directional_friction", "inertia"})
"""Effects that neither rig has: friction that differs each way is a rest position there, and the motion is not prescribed."""

TIERS: dict[Tier, tuple[float, float]] = {"faint": (1.5, 5.0), "clear": (5.0, 20.0), "strong": (20.0, 80.0)}
"""Gap that the re-identified equations leave, in units of the noise floor."""
NOISES: tuple[Noise, ...] = ("low", "high")
NOISE_SIZES: dict[Noise, float] = {"low": 5e-4, "high": 2e-3}
"""Sensor noise in units of the size of what the sensor shows."""
_COUNTS: dict[CatalogueDesign, dict[str, int]] = {
    "small": {"pair": 24, "none": 8, "parameters": 8, "outside": 3},
    "standard": {"pair": 40, "none": 16, "parameters": 16, "outside": 4},
    "joints": {"pair": 0, "none": 4, "parameters": 4, "outside": 1},
    "several": {"pair": 24, "triple": 24},
}
"""Trials of each kind besides three strengths at two noise levels of each single effect; outside: of each effect."""
_N_EFFECTS: dict[Kind, int] = {"pair": 2, "triple": 3}


@dataclass(frozen=True)
class Subject:
    """The hidden effects of one trial.

    Attributes
    ----------
    kind
        A single effect of the catalogue, two or three of them, none, wrong parameters, or an effect from outside.
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


def subject_of(design: CatalogueDesign, seed: int, trial: int) -> Subject:
    """Return what a trial hides; every pass over the list of cells is shuffled anew.

    Raises
    ------
    InputError
        If there is no such design.
    """
    cells = _cells(design)
    cycle, place = divmod(trial, len(cells))
    rng = np.random.default_rng([seed, cycle])
    cell = cells[int(rng.permutation(len(cells))[place])]
    if cell.kind in _N_EFFECTS:
        own = np.random.default_rng([seed, cycle, place])
        return replace(cell, effects=_several(own, _N_EFFECTS[cell.kind], design))
    return cell


def n_trials(design: CatalogueDesign) -> int:
    """Return the number of trials of one pass."""
    return len(_cells(design))


def hidden_effects(subject: Subject) -> tuple[Effect, ...]:
    """Return the effects that a trial hides."""
    outside = {effect.name: effect for effect in OUTSIDE}
    return tuple(outside[name] if name in outside else effect_named(name) for name in subject.effects)


def _cells(design: CatalogueDesign) -> list[Subject]:
    counts = _COUNTS[check_option("The design", design, get_args(CatalogueDesign))]  # type: ignore[index]
    tiers: tuple[Tier, ...] = tuple(TIERS)
    cells = [
        Subject("single", (effect.name,), tier, noise)
        for effect in _singles(design)
        for tier in tiers
        for noise in NOISES
    ]
    # Several effects are clear ones: a faint effect next to another is no easier to find than a faint one alone.
    cells += [
        Subject(kind, (), tiers[1 + i % 2], NOISES[i // 2 % 2])
        for kind in _N_EFFECTS
        for i in range(counts.get(kind, 0))
    ]
    cells += [Subject("none", (), None, NOISES[i % 2]) for i in range(counts.get("none", 0))]
    cells += [Subject("parameters", (), None, NOISES[i % 2]) for i in range(counts.get("parameters", 0))]
    cells += [
        Subject("outside", (effect.name,), tiers[i % 3], NOISES[(i + number) % 2])
        for number, effect in enumerate(OUTSIDE)
        for i in range(counts.get("outside", 0))
    ]
    return cells


def _singles(design: CatalogueDesign) -> tuple[Effect, ...]:
    if design == "several":
        return ()
    later = design == "joints"
    return tuple(e for e in _offered() if (e.name in OF_JOINTS) == later)


def _offered() -> tuple[Effect, ...]:
    return tuple(effect for effect in counted_effects() if effect.name not in ELSEWHERE)


def _several(rng: np.random.Generator, count: int, design: CatalogueDesign) -> tuple[str, ...]:
    """Draw effects of which none contains another."""
    effects = _offered() if design == "several" else _singles("standard")
    while True:
        drawn = [effects[int(i)] for i in rng.choice(len(effects), count, replace=False)]
        if all(_tells_apart(*pair) for pair in itertools.combinations(drawn, 2)):
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
