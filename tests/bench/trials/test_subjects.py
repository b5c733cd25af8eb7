"""Every cell is drawn once in each pass, in an order that tells nothing."""

from __future__ import annotations

import itertools
from collections import Counter
from typing import get_args

import pytest

from rigsight.diagnose import candidates_on
from rigsight.effects import CATALOGUE, kind_of
from rigsight.errors import InputError
from rigsight.rigs import RIGS
from rigsight_bench.trials.counted import COUNTED_EFFECTS
from rigsight_bench.trials.outside import LIKE_THE_CATALOGUE, OUTSIDE, UNLIKE_THE_CATALOGUE
from rigsight_bench.trials.subjects import (
    ELSEWHERE,
    NOISES,
    OF_JOINTS,
    TIERS,
    CatalogueDesign,
    hidden_effects,
    n_trials,
    subject_of,
)

DRAWN_AS_OUTSIDE = (
    "Counted trials hide an effect of blind/outside.py as one that the catalogue does not have,"
)


@pytest.mark.parametrize("design", [design for design in get_args(CatalogueDesign) if design != "several"])
def test_none_is_missed(design: CatalogueDesign) -> None:
    subjects = [subject_of(design, 3, trial) for trial in range(n_trials(design))]
    cells = Counter((s.effects, s.tier, s.noise) for s in subjects if s.kind == "single")
    drawn = {name for names, _, _ in cells for name in names}
    assert drawn == (OF_JOINTS if design == "joints" else {*COUNTED_EFFECTS} - ELSEWHERE - OF_JOINTS)
    assert cells == Counter(((name,), tier, noise) for name in drawn for tier in TIERS for noise in NOISES)
    assert {s.effects[0] for s in subjects if s.kind == "outside"} == {e.name for e in OUTSIDE}
    assert {"none", "parameters"} <= {s.kind for s in subjects}
    assert ("pair" in {s.kind for s in subjects}) == (design != "joints")


def test_several_effects_come_from_the_whole_catalogue_and_none_contains_another() -> None:
    subjects = [subject_of("several", 3, trial) for trial in range(8 * n_trials("several"))]
    assert Counter(len(s.effects) for s in subjects) == {2: 8 * 24, 3: 8 * 24}
    assert {s.kind for s in subjects} == {"pair", "triple"}
    assert {name for s in subjects for name in s.effects} == {*COUNTED_EFFECTS} - ELSEWHERE
    for subject in subjects:
        for one, other in itertools.combinations(hidden_effects(subject), 2):
            assert one.name not in other.parents
            assert other.name not in one.parents


def test_what_no_axis_and_no_gear_tells_apart_is_drawn_on_other_rigs() -> None:
    others = [rig for name, rig in RIGS.items() if name not in ("axis", "running_gear")]
    offered = {kind_of(effect.name) for rig in others for effect in candidates_on(rig, CATALOGUE)}
    assert OF_JOINTS.isdisjoint(ELSEWHERE)
    assert offered >= ELSEWHERE


def test_another_pass_and_another_seed_are_other_orders_of_the_same_cells() -> None:
    count = n_trials("small")
    first, again, second, other = (
        [subject_of("small", seed, start + trial) for trial in range(count)]
        for seed, start in ((1, 0), (1, 0), (1, count), (2, 0))
    )
    assert first == again
    assert first != second != other
    singles = [Counter(s for s in subjects if s.kind == "single") for subjects in (first, second, other)]
    assert singles[0] == singles[1] == singles[2]


def test_pairs_hold_two_effects_of_which_neither_contains_the_other() -> None:
    pairs = [
        s for s in (subject_of("standard", 5, t) for t in range(n_trials("standard"))) if s.kind == "pair"
    ]
    for subject in pairs:
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


def test_an_unknown_design_is_told() -> None:
    with pytest.raises(InputError, match="small"):
        subject_of("large", 0, 0)  # type: ignore[arg-type]
