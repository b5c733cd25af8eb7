"""Hidden effects of the trials of design ``rigs``: every counted rig with effects at every kind of its places."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TypeVar

import numpy as np

from rigsight.diagnose.fitting.placed_effects import candidates_on
from rigsight.effects import Effect, Place, kind_of, placed
from rigsight.rigs import RIGS, Rig
from rigsight_bench.trials.counted import COUNTED_RIGS, counted_effects
from rigsight_bench.trials.outside import OUTSIDE
from rigsight_bench.trials.subjects import NOISES, Kind, Noise, Tier

Item = TypeVar("Item")

_TIERS: tuple[Tier, ...] = ("clear", "strong")
"""Strengths of the effects; of a faint one neither law nor place could be found."""


@dataclass(frozen=True)
class PlacedSubject:
    """The hidden effect of one trial on a rig with several places.

    Attributes
    ----------
    rig
        Name of the built-in rig.
    kind
        As of `Subject`.
    place
        Kind of place of the effects; None where any will do, or there is none.
    tier
        Strength that is aimed for; None where there is no effect.
    noise
        Noise level.
    """

    rig: str
    kind: Kind
    place: Place | None
    tier: Tier | None
    noise: Noise


@cache
def placed_cells() -> tuple[PlacedSubject, ...]:
    """Return all cells: singles at each kind of place and of each strength, and for each rig a control and a harder trial.

    Controls alternate between no gap and wrong parameters, harder trials between two effects and one outside the catalogue.
    """
    cells: list[PlacedSubject] = []
    for number, name in enumerate(COUNTED_RIGS):
        offered = candidates_on(RIGS[name], counted_effects())
        kinds = [place for place in Place if any(effect.place is place for effect in offered)]
        rows: list[tuple[Kind, Place | None, Tier | None]] = [
            ("single", place, tier) for place in kinds for tier in _TIERS
        ]
        rows.append(("none" if number % 2 else "parameters", None, None))
        rows.append(("outside", Place.DYNAMICS, "strong") if number // 2 % 2 else ("pair", None, "strong"))
        cells += [
            PlacedSubject(name, kind, place, tier, NOISES[(number + i) % 2])
            for i, (kind, place, tier) in enumerate(rows)
        ]
    return tuple(cells)


def placed_subject_of(seed: int, trial: int) -> PlacedSubject:
    """Return what a trial hides; every pass over the list of cells is shuffled anew."""
    cells = placed_cells()
    cycle, place = divmod(trial, len(cells))
    return cells[int(np.random.default_rng([seed, cycle]).permutation(len(cells))[place])]


def draw_effects(rig: Rig, subject: PlacedSubject, rng: np.random.Generator) -> tuple[Effect, ...]:
    """Draw the effects of a trial, each with its place.

    Parameters
    ----------
    rig
        The rig.
    subject
        What is asked for.
    rng
        Source of randomness.
    """
    if subject.kind in ("none", "parameters"):
        return ()
    offered = candidates_on(rig, counted_effects())
    if subject.kind == "outside":
        return (_any_of(_outside_on(rig), rng),)
    if subject.kind == "single":
        return (_drawn_kind([e for e in offered if e.place is subject.place], rng),)
    # Two laws at one place differ only in their form; distinguishing two places is harder.
    first = _drawn_kind(offered, rng)
    others = [e for e in offered if kind_of(e.name) != kind_of(first.name) and _elsewhere(rig, first, e)]
    others = others or [e for e in offered if kind_of(e.name) != kind_of(first.name)]
    return tuple(sorted((first, _drawn_kind(others, rng)), key=lambda effect: effect.name))


def _drawn_kind(effects: list[Effect], rng: np.random.Generator) -> Effect:
    """Draw the law first and then its place, so that a law with many possible places is not drawn more often."""
    law = _any_of(sorted({kind_of(effect.name) for effect in effects}), rng)
    return _any_of([effect for effect in effects if kind_of(effect.name) == law], rng)


def _any_of(items: list[Item], rng: np.random.Generator) -> Item:
    return items[int(rng.integers(len(items)))]


def _elsewhere(rig: Rig, one: Effect, other: Effect) -> bool:
    return rig.where(one) != rig.where(other)


def _outside_on(rig: Rig) -> list[Effect]:
    """Return the effects from outside at the joints at which they have an effect: one that changes a spring needs a spring."""
    found: list[Effect] = []
    for effect in (effect for effect in OUTSIDE if effect.place is Place.DYNAMICS):
        if rig.has_one_motion:
            found.append(effect)
            continue
        reads_spring = effect.torque is not None and "k" in {s.name for s in effect.torque.free_symbols}
        found += [
            placed(effect, joint.name)
            for joint in rig.mechanism.joints
            if joint.stiffness != 0 or not reads_spring
        ]
    return [effect for effect in found if rig.offers(effect)]
