"""The page on the verdict states the thresholds that the diagnosis has, and names files that exist."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rigsight.diagnose.policy import POLICY

ROOT = Path(__file__).parents[2]
PAGE = " ".join((ROOT / "docs/verdict.md").read_text(encoding="utf-8").split())
STATED = (
    ("notes.least_rest", 100, "at least 100 samples"),
    ("notes.top_of_spectrum", 0.85, "above 85 % of the lines"),
    ("verdict.refutes_rest", 0.7, "less than 0.7 of it"),
    ("verdict.larger_part", 0.5, "at least half (a hold)"),
    ("notes.nearly_all", 0.8, "four fifths (a shift"),
    ("horizon.piece", 4.0, "in pieces of four periods"),
    ("verdict.larger_part", 0.5, "at least half the share of the best one"),
    ("search.near", 25.0, "within five times the RMS of the best"),
    ("search.promising", 9.0, "within three times the RMS of the best"),
    ("verdict.release_gain", 1.02, "lowers the held-out error by 2 %"),
    ("verdict.comparable", 1.5, "within 1.5 times the best"),
    ("verdict.sensitive", 3.0, "more than three times what they do to the linear rig"),
    ("verdict.larger_part", 0.5, "at least half of what the model leaves"),
    ("verdict.window_cycles", 4, "windows of four cycles"),
    ("verdict.comparable", 1.5, "is within 1.5 times the best"),
    ("verdict.exact", 1.03, "from 1.03 on if its residual is more than noise"),
    ("search.most_unnamed", 2, "Up to two effects are added"),
    ("verdict.larger_part", 0.5, "at least half of what the model without it leaves"),
    ("verdict.standard_errors", 3.0, "three standard errors from zero"),
    ("verdict.tie", 0.01, "1 % of the error"),
    ("verdict.model_error", 0.1, "a tenth of what the best model leaves above the floor"),
    ("verdict.inexact", 1e-3, "a thousandth of the gap"),
    ("verdict.prior_per_effect", 1.0 / 3.0, "counts a third"),
    ("verdict.inexact", 1e-3, "lowest by a thousandth"),
    ("verdict.temper", 0.1, "raised to the power 0.1"),
    ("verdict.hint", 0.9, "nine tenths to the model that is lowest"),
    ("verdict.at_floor", 1.1, "error over noise up to 1.1;"),
    ("verdict.at_lower_bound", 3.0, "up to 3 where the floor is a lower bound"),
    ("verdict.worthwhile", 1.1, "lower by a factor of 1.1"),
    ("verdict.remainder_of_gap", 0.025, "1 + 2.5 % of the gap above the floor"),
    ("verdict.least_remainder", 1.15, "at least 1.15"),
    ("verdict.most_remainder", 1.6, "at most 1.6"),
    ("verdict.significance", 0.01, "if p is at least 0.01"),
    ("verdict.against_a_floor", 0.1, "at least 0.1 if it leaves more than 1.6 of a measured floor"),
    ("verdict.stretches", 64, "(64 stretches)"),
    ("verdict.least_spread", 0.25, "less than a quarter of"),
    ("verdict.larger_part", 0.5, "the larger part (half)"),
    ("verdict.surely", 0.05, "in 19 of 20 resamplings"),
    ("verdict.comparable", 1.5, "at most 1.5 times as much"),
    ("verdict.larger_part", 0.5, "at least half of the gain"),
    ("verdict.larger_part", 0.5, "at least half of the re-identified gap closed"),
    ("verdict.exact", 1.03, "reaches 1.03 of the floor"),
    ("trust.level", 0.01, "one right model in a hundred"),
    ("trust.worth_a_step", 0.05, "squared error by more than 5 %"),
    ("trust.own_steps", 5, "or five where parameters of its own"),
    ("trust.correlated", 0.99, "correlation above 0.99"),
    ("trust.window_periods", 2.0, "at least two natural periods long"),
    ("trust.periods_alone", 15.0, "fifteen where parts"),
    ("verdict.exact", 1.03, "more than 1.03 floors"),
    ("search.basin_models", 3, "the three nearest"),
    ("search.basin_starts", 6, "from six places"),
    ("search.basin_spread", 0.3, "some 30 % off"),
    ("bootstrap.replicates", 60, "up to 60 times"),
    ("bootstrap.most_replicate_steps", 2_000_000, "more than 2 million steps"),
    ("notes.advised_amplitudes", (0.3, 1.0), "0.3 and 1 times the largest that stays within"),
)


@pytest.mark.parametrize(("number", "value", "words"), STATED)
def test_a_threshold_is_stated_as_it_is(number: str, value: object, words: str) -> None:
    group, _, name = number.partition(".")
    now = getattr(getattr(POLICY, group), name)
    assert now == value, f"{number} has changed: docs/verdict.md still says '{words}'"
    assert words in PAGE


def test_the_files_that_are_named_exist() -> None:
    named = set(re.findall(r"`(\w+\.py)`", PAGE))
    assert "judgement.py" in named
    assert named <= {file.name for file in (ROOT / "src/rigsight/diagnose").rglob("*.py")}
