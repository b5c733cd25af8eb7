"""Each verdict begins where the one before it ends."""

from __future__ import annotations

import pytest

from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.verdict.judgement import Judgement, MainCause, judge, most_remainder

ABOVE, BELOW = 1.001, 0.999


@pytest.fixture
def verdict(scored):
    def of(
        before: float,
        reidentified: float,
        best: float,
        lower_bound: bool = False,
        adequate: bool = False,
        at_least: float = 0.0,
        contradicted: bool = False,
        equalled: bool = False,
    ) -> Judgement:
        model, rival = (
            scored((name,), error_over_noise=best) for name in ("cubic_stiffness", "actuator_lag")
        )
        contradicting, equal = ((rival,) if is_so else () for is_so in (contradicted, equalled))
        return judge(
            before,
            scored((), error_over_noise=reidentified),
            model,
            lambda _: adequate,
            lambda: MainCause(at_least, at_least, contradicting, equal),
            lower_bound,
        )

    return of


def test_none_ends_at_the_floor(verdict) -> None:
    assert verdict(VERDICT.at_floor, 1.0, 1.0).verdict == "none"
    assert verdict(VERDICT.at_floor * ABOVE, 0.99, 0.99).verdict == "parameters"


def test_a_small_gap_that_new_numbers_close_is_parameters_from_a_tenth_on(verdict) -> None:
    assert verdict(1.1 * 1.05 * ABOVE, 1.05, 1.0).verdict == "parameters"
    assert verdict(1.1 * 1.05 * BELOW, 1.05, 1.0).verdict == "none"


def test_a_simulation_that_suits_the_held_out_records_by_chance_is_not_complete(verdict) -> None:
    """Fitted to one sweep it predicts another; no numbers suit all sweeps, with the effect they do."""
    assert verdict(1.05, 1.3, 1.0).verdict == "effect"
    assert verdict(1.05, 1.3, 1.3 / 1.1 * ABOVE).verdict == "none"


def test_parameters_when_the_same_equations_reach_the_floor(verdict) -> None:
    found = verdict(5.0, VERDICT.at_floor, VERDICT.at_floor)
    assert (found.verdict, found.model.effects) == ("parameters", ())


def test_new_numbers_that_halve_a_gap_but_miss_the_floor_are_not_the_cause(verdict) -> None:
    assert verdict(20.0, 10.0, 10.0).verdict == "unknown"


def test_the_simple_explanation_wins_where_both_reach_the_floor(verdict) -> None:
    assert verdict(5.0, 1.05, 1.0).verdict == "parameters"


def test_an_effect_must_lower_the_error_by_a_tenth(verdict) -> None:
    assert verdict(5.0, 1.15, 1.15 / 1.1 * BELOW).verdict == "effect"
    assert verdict(5.0, 1.15, 1.15 / 1.1 * ABOVE).verdict == "unknown"


def test_what_goes_with_nothing_is_noise_whatever_the_floor_says(verdict) -> None:
    assert verdict(100.0, 100.0, 5.0, adequate=True).verdict == "effect"
    assert verdict(100.0, 50.0, 50.0, adequate=True).verdict == "parameters"
    assert verdict(50.0, 50.0, 50.0, adequate=True).verdict == "none"


def test_a_main_cause_is_named_with_what_it_leaves(verdict) -> None:
    found = verdict(100.0, 100.0, 30.0, at_least=0.51)
    assert found.verdict == "effect"
    assert "main cause" in found.reason
    assert "30 times the noise floor" in found.reason


def test_what_takes_less_than_the_larger_part_is_not_the_main_cause(verdict) -> None:
    found = verdict(100.0, 100.0, 75.0, at_least=0.49)
    assert found.verdict == "unknown"
    assert "cubic_stiffness" in found.reason


def test_models_that_are_as_good_and_explain_another_part_are_reported(verdict) -> None:
    found = verdict(100.0, 100.0, 30.0, at_least=0.9, contradicted=True)
    assert found.verdict == "effect"
    assert "actuator_lag" in found.reason


def test_models_that_explain_the_same_part_from_elsewhere_are_told(verdict) -> None:
    found = verdict(100.0, 100.0, 30.0, at_least=0.9, equalled=True)
    assert found.verdict == "effect"
    assert "explain the same part of it (actuator_lag)" in found.reason


@pytest.mark.parametrize(
    ("gap", "allowed"), [(2.0, 1.15), (7.0, 1.15), (13.0, 1.3), (25.0, 1.6), (100.0, 1.6)]
)
def test_of_a_larger_gap_a_cause_may_leave_more(verdict, gap: float, allowed: float) -> None:
    """A fortieth of the gap, between 1.15 and 1.6 times the floor."""
    assert most_remainder(gap) == pytest.approx(allowed)
    assert verdict(gap, gap, allowed * BELOW).verdict == "effect"
    assert verdict(gap, gap, allowed * ABOVE).verdict == "unknown"


def test_above_a_lower_bound_an_effect_may_leave_more(verdict) -> None:
    assert verdict(12.0, 12.0, 3.0 * BELOW, lower_bound=True).verdict == "effect"
    found = verdict(12.0, 12.0, 3.0 * ABOVE, lower_bound=True, at_least=0.9)
    assert found.verdict == "effect"
    assert "the lower bound of the noise floor" in found.reason
    assert verdict(12.0, 12.0, 3.0 * ABOVE, lower_bound=True).verdict == "unknown"


def test_an_effect_that_reaches_the_floor_is_named_whatever_the_gap_was(verdict) -> None:
    found = verdict(1.3, 1.25, 1.09)
    assert found.verdict == "effect"
    assert found.model.names == ("cubic_stiffness",)


def test_an_effect_that_leaves_something_says_so(verdict) -> None:
    found = verdict(20.0, 20.0, 1.2)
    assert found.verdict == "effect"
    assert "1.2 times the noise floor" in found.reason


def test_a_failed_candidate_explains_nothing(verdict) -> None:
    found = verdict(20.0, 20.0, float("inf"))
    assert (found.verdict, found.model.effects) == ("unknown", ())


def test_equations_that_cannot_be_identified_leave_the_effect(verdict) -> None:
    """The re-identified equations may diverge on a held-out record; an effect at the floor is still found."""
    assert verdict(20.0, float("inf"), 1.0).verdict == "effect"
