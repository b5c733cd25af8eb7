"""Every cell is drawn once in each pass, in an order that tells nothing."""

from __future__ import annotations

from collections import Counter

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, kind_of
from rigsight.rigs import RIGS
from rigsight_bench.trials.counted import COUNTED_EFFECTS
from rigsight_bench.trials.kinds import TIERS
from rigsight_bench.trials.standard.outside import LIKE_THE_CATALOGUE, OUTSIDE, UNLIKE_THE_CATALOGUE
from rigsight_bench.trials.standard.subjects import (
    ELSEWHERE,
    NOISES,
    Subject,
    hidden_effects,
    standard_cells,
    standard_subject_of,
)

DRAWN_AS_OUTSIDE = "Counted trials hide an effect of outside.py as one that the catalogue does not have,"


def a_pass(seed: int, start: int = 0) -> list[Subject]:
    return [standard_subject_of(seed, start + trial) for trial in range(len(standard_cells()))]


def test_none_is_missed() -> None:
    subjects = a_pass(3)
    cells = Counter((s.effects, s.tier, s.noise) for s in subjects if s.kind == "single")
    drawn = {*COUNTED_EFFECTS} - ELSEWHERE
    assert cells == Counter(((name,), tier, noise) for name in drawn for tier in TIERS for noise in NOISES)
    assert {s.effects[0] for s in subjects if s.kind == "outside"} == {e.name for e in OUTSIDE}
    assert {"none", "parameters", "pair"} <= {s.kind for s in subjects}


def test_what_no_axis_and_no_gear_tells_apart_is_drawn_on_other_rigs() -> None:
    others = [rig for name, rig in RIGS.items() if name not in ("axis", "running_gear")]
    offered = {kind_of(effect.name) for rig in others for effect in candidates_on(rig, CATALOGUE)}
    assert offered >= ELSEWHERE


def test_another_pass_and_another_seed_are_other_orders_of_the_same_cells() -> None:
    first, again, other = a_pass(1), a_pass(1), a_pass(2)
    second = a_pass(1, start=len(first))
    assert first == again
    assert first != second != other
    singles = [Counter(s for s in subjects if s.kind == "single") for subjects in (first, second, other)]
    assert singles[0] == singles[1] == singles[2]


def test_pairs_hold_two_effects_of_which_neither_contains_the_other() -> None:
    for subject in (s for s in a_pass(5) if s.kind == "pair"):
        first, second = hidden_effects(subject)
        assert first.name != second.name
        assert first.name not in second.parents
        assert second.name not in first.parents


def test_effects_from_outside_are_none_of_the_catalogue() -> None:
    known = {effect.name for effect in CATALOGUE}
    laws = {(e.torque, e.drive, e.spring, e.measured) for e in CATALOGUE}
    assert len(UNLIKE_THE_CATALOGUE) >= 3
    assert len(LIKE_THE_CATALOGUE) >= 3
    for effect in OUTSIDE:
        assert effect.name not in known, f"{DRAWN_AS_OUTSIDE} {effect.name}: give the effect another name."
        law = effect.torque, effect.drive, effect.spring, effect.measured
        assert law not in laws, (
            f"{DRAWN_AS_OUTSIDE} {effect.name}: with this law they have to be counted anew."
        )
