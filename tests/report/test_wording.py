from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from rigsight.diagnose.noise.adequacy import Remainder
from rigsight.diagnose.result import Diagnosis, Estimate
from rigsight.diagnose.verdict.families import FamilyAtPlace, Shares
from rigsight.effects import Family
from rigsight.report.labels import Written, estimate_text, gap_percent, percent, written
from rigsight.report.wording import (
    advice_sentences,
    remainder_sentence,
    verdict_name,
    verdict_sentence,
    what_is_probable,
)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("two effects", "may be caused by Coulomb friction and cubic stiffness in the yaw dynamics (probability 6 %"),
        ("own effect", "caused by my gear"),
        ("parameters", "caused by wrong parameters: refitting the same equations closes over 99.9 %"),
        ("none", "no gap to explain: the given simulation leaves 1.02 × the noise floor"),
        ("unknown", "unknown: the best of 4 candidates, Bouc-Wen hysteresis, still leaves 1.04 × the noise floor; "
                    "the evidence points to a cause in the yaw dynamics."),
        ("no candidates", "The cause of the gap is unknown."),
        ("element", "in the dynamics"),
    ],
)  # fmt: skip
def test_the_verdict_is_one_plain_sentence(
    variant: Callable[[str], Diagnosis], name: str, words: str
) -> None:
    sentence = verdict_sentence(variant(name))
    assert words in sentence
    assert sentence.endswith(".")
    assert "nan" not in sentence


def test_an_effect_has_no_share_of_what_refitting_closed(variant: Callable[[str], Diagnosis]) -> None:
    named = variant("effect")
    # In floors: 101 as given, 11 refitted, 6 with the effect, which closes half and not 95 %.
    gap = {
        name: replace(g, before=1.01, reidentified=0.11, after=0.06, noise_floor=0.01)
        for name, g in named.gap.items()
    }
    sentence = verdict_sentence(replace(named, gap=gap))
    assert "closes 50 % of the gap that refitting leaves" in sentence
    refitted = verdict_sentence(replace(variant("parameters"), gap=gap))
    assert "closes 95 % of the gap" in refitted


def test_a_cause_that_the_motion_names_is_not_said_to_close_the_gap(
    variant: Callable[[str], Diagnosis],
) -> None:
    named = variant("effect")
    gap = {
        name: replace(g, before=1.01, reidentified=0.11, after=0.12, noise_floor=0.01)
        for name, g in named.gap.items()
    }
    friction = FamilyAtPlace(Family.DRY_FRICTION, "yaw_dynamics", 0.92, 0.79, (0.78, 0.81), (), 0.79)
    found = replace(
        named,
        effects=("coulomb_friction",),
        ambiguous_with=(),
        gap=gap,
        families=(friction,),
        shares=Shares(0.79, 0.19, 0.02, "motion"),
        remainder=Remainder(0.94, ("x",), "change of x", 0.001),
    )
    sentence = verdict_sentence(found)
    assert "along the measured motion is mainly explained by Coulomb friction" in sentence
    assert ": 79 % of the square of that force." in sentence
    assert "closes none of the gap that refitting leaves; with it 12 × the noise floor remains" in sentence
    assert remainder_sentence(found) == ""
    unsure = verdict_sentence(replace(found, families=(replace(friction, probability=0.26),)))
    assert "may be mainly explained by Coulomb friction" in unsure
    assert "(probability 26 %)" in unsure
    assert verdict_name(replace(found, families=(replace(friction, probability=0.26),))) == "Possible cause"


def test_no_gap_far_above_the_floor_says_that_the_floor_seems_too_low(
    variant: Callable[[str], Diagnosis],
) -> None:
    none = variant("none")
    far = {
        name: replace(gap, before=300.0 * gap.noise_floor, reidentified=300.0 * gap.noise_floor)
        for name, gap in none.gap.items()
    }
    sentence = verdict_sentence(replace(none, gap=far))
    assert "correlates with no signal" in sentence
    assert "noise floor is probably too low" in sentence
    assert "too small" not in sentence


@pytest.mark.parametrize(
    ("name", "cause"),
    [
        ("effect", "Bouc-Wen hysteresis"), ("parameters", "no missing effect"), ("none", "no missing effect"),
        ("unknown", "a cause that is none of the families"),
    ],
)  # fmt: skip
def test_every_verdict_has_the_probability_of_what_it_states(
    variant: Callable[[str], Diagnosis], name: str, cause: str
) -> None:
    diagnosis = variant(name)
    tried = {candidate.effects: candidate.probability for candidate in diagnosis.candidates}
    stated = 1.0 if name == "unknown" else tried.get(diagnosis.effects, 0.0)  # No family is likely.
    assert diagnosis.probability == pytest.approx(stated)
    assert diagnosis.to_json()["probability"] == diagnosis.probability
    assert what_is_probable(diagnosis) == cause


def test_an_unknown_cause_says_with_what_the_rest_goes(variant: Callable[[str], Diagnosis]) -> None:
    left = Remainder(0.89, ("pivot",), "velocity of pivot", 0.0008)
    sentence = remainder_sentence(replace(variant("unknown"), remainder=left))
    assert "89 % of the squared gap, still correlates with velocity of pivot" in sentence
    assert "more than half of the gap is not explained" in sentence


def test_beside_an_unknown_cause_nothing_smaller_is_missing() -> None:
    left = Remainder(0.1, ("elbow",), "change of angle_2", 0.002, beside_a_cause=False)
    assert left.text.endswith("correlates with change of angle_2 (p = 0.002).")
    assert "a smaller effect is missing too" in replace(left, beside_a_cause=True).text


def test_a_number_that_differs_by_record_is_told_as_such() -> None:
    left = Remainder(0.02, (), "record: T_c", 0.001)
    assert "still correlates with the record: T_c differs from record to record" in left.text


def test_no_more_than_the_noise_is_no_second_cause(variant: Callable[[str], Diagnosis]) -> None:
    """What goes with something below the floor is told of the numbers, and not as something smaller that is missing too."""
    left = Remainder(0.0, (), "record: d_r", 0.003)
    assert "within the noise floor, but it still correlates with the record" in left.text
    unknown_noise = Remainder(0.0, (), "record: d_r", 0.003, is_part=True)
    assert unknown_noise.text.startswith(
        "A very small part of the remaining error still correlates with the record"
    )
    found = replace(variant("effect"), adequate=False, remainder=left)
    assert verdict_name(found) == "Missing effect"
    assert verdict_name(replace(found, remainder=replace(left, share=0.02))) == "Main cause"


def test_nearly_all_is_not_rounded_to_all() -> None:
    assert [percent(x) for x in (0.5, 0.9961, 0.99996, 1.0, float("nan"))] == [
        "50 %", "99.6 %", "over 99.9 %", "100 %", "an unknown share",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "std", "expected"),
    [
        (81.234, 1.34, Written("81.2", "1.3", 0)),
        (0.0, 0.02, Written("0.000", "0.020", 0)),
        (3.1e5, 2e3, Written("3.100", "0.020", 5)),
        (-4.5e-7, 1e-8, Written("-4.50", "0.10", -7)),
        (1234.5, 250.0, Written("1234", "250", 0)),
        (2.5, float("inf"), Written("2.5", "", 0)),
        (2.5, 0.0, Written("2.5", "", 0)),
        (float("nan"), 1.0, Written("not finite", "", 0)),
        (-0.0, 0.0, Written("0", "", 0)),
        (-1e-3, 0.5, Written("0.00", "0.50", 0)),
    ],
)
def test_only_digits_that_the_records_support(value: float, std: float, expected: Written) -> None:
    assert written(value, std) == expected


def test_gaps_are_written_as_people_do() -> None:
    assert [gap_percent(x) for x in (0.00941, 0.42, 9.994, 14.37, 6420.0, 3.2e7, float("nan"))] == [
        "0.941 %", "42 %", "999 %", "1400 %", "640000 %", "3.2e+09 %", "not finite",
    ]  # fmt: skip


def test_an_estimate_in_ascii() -> None:
    assert estimate_text(Estimate(3.1e5, 2e3, "N m/rad^3")) == "(3.100 +/- 0.020)e+5 N m/rad^3"
    assert estimate_text(Estimate(0.5, 0.01, "1")) == "0.500 +/- 0.010"
    assert estimate_text(Estimate(0.5, float("inf"), "1")) == "not determined by these records"


def test_a_separation_far_above_the_noise_is_not_told_as_a_number(
    variant: Callable[[str], Diagnosis],
) -> None:
    advised = variant("advised")
    far = replace(advised, advice=(replace(advised.advice[0], separation=9364682.0),))
    (sentence,) = advice_sentences(far)
    assert "9364682" not in sentence
    assert "100" in sentence


def test_effects_at_several_places_are_each_called_with_their_own(
    variant: Callable[[str], Diagnosis],
) -> None:
    found = replace(
        variant("effect"), effects=("quadratic_damping", "time_shift@gyro"), where=("bearing", "gyro")
    )
    assert "quadratic damping at bearing and time shift at gyro" in verdict_sentence(found)
