"""The page on the verdict states the thresholds that the diagnosis has, and names files that exist."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = " ".join((ROOT / "docs/verdict.md").read_text(encoding="utf-8").split())
STATED = {
    "detect._MIN_QUIET": (100, "at least 100 samples"),
    "detect._TOP_OF_SPECTRUM": (0.85, "above 85 % of the lines"),
    "diagnosis._REFUTES": (0.7, "less than 0.7 of a floor"),
    "data.input_timing._GOOD_PART": (0.5, "at least half (a hold)"),
    "data.input_timing._NEARLY_ALL": (0.8, "four fifths (a shift)"),
    "workbench._PIECE": (4.0, "in pieces of four periods"),
    "places.search._WORTH_LOOKING": (0.5, "at least half the share of the best one"),
    "candidates.first_look._NEAR": (25.0, "within five times the RMS of the best"),
    "candidates.characterize._PROMISING": (9.0, "within three times the RMS of the best"),
    "candidates.characterize._RELEASE_GAIN": (1.02, "lowers the held-out error by 2 %"),
    "candidates.characterize.CONTENDER": (1.5, "within 1.5 times the best"),
    "predictability.PREDICTABLE": (3.0, "more than three times what they do to the linear rig"),
    "candidates.chance._BY_CHANCE": (0.5, "at least half of what the model leaves"),
    "windows._CYCLES": (4, "windows of four cycles"),
    "candidates.third_effect.IN_ITS_PLACE": (1.5, "(within 1.5 times)"),
    "candidates.grow._BEAM": (1.3, "within 1.3 times the best error"),
    "candidates.grow._NOTHING_LEFT": (1.03, "leaves more than 1.03 of the floor"),
    "candidates.grow._FINEST_STEPS": (4, "more than 4 integration steps per sample"),
    "candidates.grow._HALF": (0.5, "at least half of what the best single effect leaves"),
    "examination._SIGNIFICANT": (3.0, "three standard errors from zero"),
    "rank._TIE": (0.01, "1 % of the error"),
    "rank._MODEL_ERROR": (0.1, "a tenth of what the best model leaves above the floor"),
    "rank._INEXACT": (1e-3, "a thousandth of the gap"),
    "rank._PRIOR_PER_EFFECT": (1.0 / 3.0, "counts a third"),
    "rank._FINE": (1e-3, "lowest by a thousandth"),
    "rank._TEMPER": (0.1, "raised to the power 0.1"),
    "rank._HINT": (0.9, "nine tenths to the model that is lowest"),
    "verdict.AT_FLOOR": (1.1, "excess up to 1.1;"),
    "verdict.AT_LOWER_BOUND": (3.0, "up to 3 where the floor is a lower bound"),
    "verdict.WORTHWHILE": (1.1, "lower by a factor of 1.1"),
    "verdict._LEFT_OF_GAP": (0.025, "1 + 2.5 % of the gap's excess"),
    "verdict.LEAST_LEFT": (1.15, "at least 1.15"),
    "verdict.MOST_LEFT": (1.6, "at most 1.6"),
    "adequacy.SIGNIFICANCE": (0.01, "from p = 0.01 on"),
    "adequacy.AGAINST_A_FLOOR": (0.1, "from 0.1 on where it leaves more than 1.6 of a measured floor"),
    "adequacy._STRETCHES": (64, "(64 stretches)"),
    "adequacy._LONG_STRETCHES": (32, "a quarter of 32"),
    "adequacy._LEAST_SPREAD": (0.25, "less than a quarter of"),
    "main_cause.LARGER_PART": (0.5, "the larger part (half)"),
    "main_cause._SURELY": (0.05, "in 19 of 20 resamplings"),
    "plausibility._AS_GOOD": (1.5, "at most 1.5 times as much"),
    "candidates.basins._EXPLAINED": (1.05, "more than 1.05 floors"),
    "candidates.basins._MOST_MODELS": (3, "the three nearest"),
    "candidates.basins._N_STARTS": (6, "from six places"),
    "candidates.basins._SPREAD": (0.3, "some 30 % off"),
    "candidates.basins._SURELY": (9.0, "lower by 9"),
    "uncertainty.bootstrap.N_REPLICATES": (60, "up to 60 times"),
    "uncertainty.bootstrap._MOST_STEPS": (2_000_000, "more than 2 million steps"),
    "second_cause._OTHER_FORM": (0.5, "from half of the gain on"),
    "verdict._HALF": (0.5, "at least half of the re-identified gap closed"),
    "in_catalogue._ODDS_OUTSIDE_ONE": (0.25, "1 : 4 against one effect"),
    "in_catalogue._ODDS_OUTSIDE_SEVERAL": (1.0, "1 : 1 against several"),
    "in_catalogue._ONE_LAW": (0.5, "get at most one half"),
    "candidates.one_law._EXACT": (1.03, "reach 1.03 of the floor"),
    "in_catalogue._AT_MOST_UNKNOWN": (0.3, "together get 0.3"),
    "advise._AMPLITUDES": ((0.3, 1.0, 1.5), "0.3, 1 and 1.5 times the largest input"),
}


@pytest.mark.parametrize("constant", STATED)
def test_a_threshold_is_stated_as_it_is(constant: str) -> None:
    module, _, name = constant.rpartition(".")
    value, words = STATED[constant]
    now = getattr(importlib.import_module(f"rigsight.diagnose.{module}"), name)
    assert now == value, f"{constant} has changed: docs/verdict.md still says '{words}'"
    assert words in PAGE


def test_the_files_that_are_named_exist() -> None:
    named = set(re.findall(r"`(\w+\.py)`", PAGE))
    assert "verdict.py" in named
    assert named <= {file.name for file in (ROOT / "src/rigsight/diagnose").rglob("*.py")}
