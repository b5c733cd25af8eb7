"""Probabilities come from the calibration: they add up, and they fall where less speaks for the cause."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.diagnose.verdict.calibration import Situation, trained

CLEAR = Situation(
    verdict="effect",
    first_share=1.0,
    remainder=1.02,
    gap=30.0,
    n_effects=1,
    adequate=True,
    lower_bound=False,
    several_places=False,
)


def stated(situation: Situation) -> float:
    return trained().probabilities(situation, [situation.first_share, 1.0 - situation.first_share])[0]


def test_probabilities_and_what_is_left_for_all_else_add_up_to_one() -> None:
    calibration = trained()
    reported = calibration.probabilities(CLEAR, [0.7, 0.2, 0.1])
    assert sum(reported) == pytest.approx(calibration.probability_listed(CLEAR))
    assert reported[1] == pytest.approx(2.0 * reported[2])
    assert calibration.without_effect(CLEAR) == 0.0


def test_without_a_gap_the_equations_alone_are_probable() -> None:
    calm = replace(CLEAR, verdict="none", gap=1.0, remainder=1.0, n_effects=0)
    calibration = trained()
    others = calibration.probabilities(calm, [0.5, 0.5])
    assert calibration.without_effect(calm) > 0.8
    assert calibration.without_effect(calm) + sum(others) == pytest.approx(
        calibration.probability_listed(calm)
    )


def test_a_clear_cause_is_probable() -> None:
    assert stated(CLEAR) > 0.9


@pytest.mark.parametrize(
    "worse",
    [
        {"first_share": 0.5},
        {"remainder": 5.0, "adequate": False},
        {"gap": 1.3},
        {"verdict": "unknown", "remainder": 5.0, "adequate": False},
    ],
    ids=str,
)
def test_less_evidence_is_less_probable(worse: dict) -> None:
    assert stated(replace(CLEAR, **worse)) < stated(CLEAR) - 0.02


def test_of_an_unknown_cause_the_nearest_model_is_less_probable_than_if_it_were_named() -> None:
    far = replace(CLEAR, remainder=5.0, adequate=False)
    assert stated(replace(far, verdict="unknown")) < stated(far) - 0.02


def test_a_model_that_is_endlessly_far_is_not_the_cause() -> None:
    for left in (1e300, float("inf")):
        far = replace(CLEAR, verdict="unknown", remainder=left, adequate=False)
        assert stated(far) == 0.0
        assert stated(replace(far, gap=3000.0)) == 0.0, "and beyond the gaps of the training trials"


def test_one_model_alone_takes_what_the_first_has() -> None:
    calibration = trained()
    assert calibration.probabilities(CLEAR, []) == []
    assert calibration.probabilities(CLEAR, [1.0]) == [stated(CLEAR)]


def test_no_rival_is_more_probable_than_the_doubted_first_model() -> None:
    doubted = replace(CLEAR, first_share=0.503, remainder=1.15, n_effects=2, adequate=False)
    calibration = trained()
    first, second, third = calibration.probabilities(doubted, [0.503, 0.49, 0.007])
    assert calibration.probability_first(doubted) < 0.5
    assert first == pytest.approx(second)
    assert third < 0.1 * second
    assert first + second + third == pytest.approx(calibration.probability_listed(doubted))


def test_less_noise_than_in_any_training_trial_takes_nothing_from_a_main_cause() -> None:
    """A law that leaves a sixtieth of the gap; a tenth of the noise raises error and gap alike."""
    quiet = replace(CLEAR, remainder=50.0, gap=3000.0, adequate=False)
    quieter = replace(quiet, remainder=500.0, gap=30_000.0)
    assert stated(quiet) > 0.5
    assert stated(quieter) == pytest.approx(stated(quiet), rel=1e-3)


def test_a_gap_beyond_the_training_trials_says_no_more_than_their_largest() -> None:
    assert stated(replace(CLEAR, gap=1e6)) == pytest.approx(
        stated(replace(CLEAR, gap=trained().largest_gap, remainder=1.0)), rel=1e-3
    )
