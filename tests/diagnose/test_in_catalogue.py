"""The share left for causes that nobody thought of is larger where the gap is faint and where two effects are needed."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.verdict.catalogue_coverage import probability_in_catalogue
from rigsight.diagnose.verdict.judgement import Judgement
from rigsight.diagnose.verdict.ranking import Grounds, Ranking

NOISE = np.random.default_rng(0).standard_normal(2000)


@pytest.fixture
def stated(scored):
    def of(effects: tuple[str, ...], left: float, gap: float, single: float | None = None, verdict="effect"):
        model = scored(effects, left * NOISE)
        others = (
            ()
            if single is None
            else (scored((effects[0],), single * NOISE), scored(("backlash",), gap * NOISE))
        )
        order = (model, *others)
        ranking = Ranking(
            order, tuple(1.0 / len(order) for _ in order), (), tuple(Grounds(0.0, None) for _ in order)
        )
        return probability_in_catalogue(Judgement(verdict, model, ""), ranking, gap)

    return of


def test_single_effect_that_closes_a_large_gap_is_nearly_sure(stated) -> None:
    assert stated(("free_play",), 1.0, 50.0) > 0.98


def test_fainter_gaps_leave_more_to_causes_from_outside(stated) -> None:
    shares = [stated(("free_play",), 1.0, gap) for gap in (1.2, 2.0, 5.0, 20.0)]
    assert shares == sorted(shares)
    assert shares[0] < 0.85


def test_second_effect_that_had_little_to_explain_is_believed_by_half(stated) -> None:
    pair = ("free_play", "input_delay")
    assert stated(pair, 1.0, 50.0, single=1.15) == pytest.approx(0.5, abs=0.02)
    assert stated(pair, 1.0, 50.0, single=20.0) > 0.9


def test_more_left_above_the_floor_is_less_sure(stated) -> None:
    assert (
        stated(("free_play",), 3.0, 20.0)
        < stated(("free_play",), 1.2, 20.0)
        < stated(("free_play",), 1.0, 20.0)
    )


def test_more_left_than_a_measured_floor_would_allow_is_never_more_than_half_sure(stated) -> None:
    assert stated(("free_play",), 1.16, 5.0) <= 0.5
    assert stated(("free_play",), 1.14, 5.0) > 0.9


@pytest.mark.parametrize(
    "pair",
    [
        ("quadratic_damping", "stribeck_friction"),
        ("bouc_wen_hysteresis", "gravity_pendulum"),
        ("free_play", "end_stop"),
        ("cubic_stiffness", "backlash"),
        ("flexible_mode", "actuator_lag"),
        ("input_delay", "flexible_mode"),
    ],
)
def test_two_effects_that_are_one_law_are_never_more_than_half_sure(stated, pair) -> None:
    assert stated(pair, 1.0, 50.0, single=20.0) <= 0.5


@pytest.mark.parametrize(
    "pair", [("bouc_wen_hysteresis", "quadratic_damping"), ("cubic_stiffness", "flexible_mode")]
)
def test_two_effects_of_different_parts_may_be_sure(stated, pair) -> None:
    assert stated(pair, 1.0, 50.0, single=20.0) > 0.9


def test_unknown_leaves_little_for_all_candidates_and_no_gap_none(stated) -> None:
    assert stated(("free_play",), 2.0, 50.0, verdict="unknown") == 0.3
    assert stated(("free_play",), 1.0, 50.0, verdict="none") == 0.0
