"""Many outcomes are counted by truth, by stated probability, by error and by every label of their key."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rigsight_bench.scoring import Outcome, ParameterError, WithheldError, summary
from rigsight_bench.scoring.summary import (
    ALL,
    WRONG_PLACE,
    confusion,
    held_out,
    parameters,
    reliability,
    several,
)

Like = Callable[..., Outcome]


@pytest.fixture
def outcomes(outcome_like: Like, wrong_outcome: Like) -> list[Outcome]:
    control = {"kind": "none", "effects": (), "named": (), "verdict": "none", "tier": "", "gap": 1.0}
    return [
        outcome_like(trial="000", stated=0.99),
        wrong_outcome(trial="001", stated=0.7),
        outcome_like(trial="002", stated=0.97, place_right=None, **control),
        wrong_outcome(trial="003", kind="outside", effects=("drifting_sensor",), named=("sensor_lag",), stated=0.7),
        wrong_outcome(trial="004", verdict="failed", named=(), stated=0.0),
    ]  # fmt: skip


def test_truth_and_verdict_are_counted(outcomes: list[Outcome]) -> None:
    table = confusion(outcomes)
    assert table["backlash"] == {"backlash": 1, "free_play": 1, "failed": 1}
    assert table["outside: drifting_sensor"] == {"sensor_lag": 1}
    assert table["none"] == {"none": 1}


def test_stated_probabilities_are_counted_and_a_failure_states_none(outcomes: list[Outcome]) -> None:
    bins = {row["to"]: row["right"] for row in reliability(outcomes)}
    assert (bins[1.0]["count"], bins[1.0]["total"]) == (2, 2)
    assert (bins[0.8]["count"], bins[0.8]["total"]) == (0, 2)
    assert bins[0.2]["total"] == 0


@pytest.mark.parametrize(
    ("named", "verdict", "what"),
    [
        (("backlash", "input_delay"), "effect", "both"),
        (("backlash",), "effect", "one alone"),
        (("backlash", "free_play"), "effect", "one with another"),
        (("backlash", "input_delay", "sensor_lag"), "effect", "both and another"),
        (("free_play",), "effect", "others"),
        ((), "unknown", "unknown"),
    ],
)
def test_a_pair_is_named_whole_in_part_or_not(
    outcome_like: Like, named: tuple[str, ...], verdict: str, what: str
) -> None:
    pair = ("backlash", "input_delay")
    right = named == pair
    found = outcome_like(
        kind="pair", effects=pair, named=named, verdict=verdict, right=right, effect_right=right
    )
    assert several([found], "pair") == {what: 1}


def test_the_right_effects_at_a_wrong_place_are_a_verdict_of_their_own(wrong_outcome: Like) -> None:
    single = wrong_outcome(named=("backlash",), effect_right=True, looked_at=True)
    pair = wrong_outcome(
        kind="pair", effects=("backlash", "input_delay"), named=("backlash", "input_delay"), effect_right=True
    )
    assert confusion([single])["backlash"] == {WRONG_PLACE: 1}
    assert several([pair], "pair") == {WRONG_PLACE: 1}
    figures = summary([single, pair])["by"]["rig"]["axis"]
    assert (figures["right"]["count"], figures["effect_right"]["count"]) == (0, 2)
    assert (figures["looked_at"]["count"], figures["looked_at"]["total"]) == (1, 1)


def test_trials_of_a_laboratory_are_counted_by_condition(outcome_like: Like, wrong_outcome: Like) -> None:
    unknown = {"verdict": "unknown", "named": (), "condition": "drift"}
    found = summary(
        [
            wrong_outcome(stated=0.6, seconds=10.0, **unknown),
            wrong_outcome(stated=0.8, seconds=30.0, **unknown),
            outcome_like(condition="clean", stated=0.99, seconds=5.0),
            wrong_outcome(condition="clean", seconds=5.0),
            wrong_outcome(condition="clean", seconds=5.0, verdict="failed", named=()),
            outcome_like(),
        ]
    )["conditions"]
    assert list(found) == ["clean", "drift", ALL]
    assert {name: row["laboratory_right"]["total"] for name, row in found.items()} == {
        "clean": 3, "drift": 2, ALL: 5,
    }  # fmt: skip
    figures = ("laboratory_right", "laboratory_wrong_name", "unknown", "neither")
    assert [found["clean"][figure]["count"] for figure in figures] == [1, 1, 0, 1]
    assert (found["drift"]["unknown"]["count"], found["drift"]["largest_unknown"]) == (2, 0.8)
    assert (found["clean"]["largest_unknown"], found["drift"]["seconds_median"]) == (None, 20.0)
    assert summary([outcome_like()])["conditions"] == {}


def test_the_main_one_of_several_effects_stands_where_all_of_them_would(outcome_like: Like) -> None:
    three = ("backlash", "input_delay", "quadratic_damping")
    main = outcome_like(kind="several", effects=three, named=("backlash",), condition="three_effects")
    assert confusion([main]) == {" + ".join(three): {" + ".join(three): 1}}


def test_withheld_records_are_grouped_by_kind_and_amplitude(outcome_like: Like) -> None:
    seen = (
        WithheldError("a", "multisine", 0.7, 8000, 1.0),
        WithheldError("b", "step", 0.75, 3000, 1.2),
        WithheldError("c", "step", 1.3, 3000, None),
    )
    found = held_out([outcome_like(withheld=seen), outcome_like(withheld=seen[:2])])
    assert {name: row["count"] for name, row in found["by_record"].items()} == {
        "multisine, 0.5 to 0.75": 2,
        "step, 0.5 to 0.75": 2,
        "step, above 1": 1,
    }
    assert found["by_record"]["step, 0.5 to 0.75"]["median"] == 1.2
    assert found["by_record"]["step, above 1"]["median"] is None


def test_every_model_is_in_one_class_of_error(outcome_like: Like, wrong_outcome: Like) -> None:
    one = [outcome_like(held_out=e) for e in (0.9, 0.95, 1.0, 99.0)] + [wrong_outcome(held_out=None)]
    foreign = wrong_outcome(kind="outside", effects=("x",), held_out=50.0)
    rows = held_out([*one, foreign])["histogram"]
    assert sum(row["right"] for row in rows) == 4
    assert sum(row["wrong"] for row in rows) == 1
    assert (rows[0]["to"], rows[0]["right"]) == (0.95, 1)
    assert (rows[-1]["to"], rows[-1]["right"], rows[-1]["wrong"]) == (None, 1, 1)


def test_parameter_errors_are_sized_for_rig_and_effect(outcome_like: Like) -> None:
    rows = [("k", "rig", -1.0), ("k", "rig", 1.0), ("k", "rig", 3.0), ("g", "backlash", -2.0)]
    errors = tuple(ParameterError(*row) for row in rows)
    found = parameters([outcome_like(parameters=errors)])
    assert list(found) == ["all", "rig", "backlash"]
    assert found["rig"] == {"count": 3, "within_2": pytest.approx(2 / 3), "median": 1.0, "quantile_95": 3.0}
    assert found["backlash"]["within_2"] == 1.0
    assert found["all"]["count"] == 4


def test_figures_come_for_every_label(outcomes: list[Outcome]) -> None:
    found = summary(outcomes)
    assert found["by"]["kind"]["none"]["right"]["count"] == 1
    assert found["by"]["tier"]["no effect"]["place_right"]["total"] == 0
    assert found["by"]["effect"]["backlash"]["right"]["total"] == 3
    assert found["goals"]["outside_named_above_half"]["count"] == 1
    assert found["seconds"] == {"median": 20.0, "quantile_95": 20.0, "total": 100.0}
    assert found["scored_by"] == {"1.0": 5}


def test_nothing_adds_up_to_nothing() -> None:
    found = summary([])
    assert found["goals"]["singles_right"]["share"] is None
    assert all(row["reached"] is None for row in found["targets"])
    assert found["by"]["kind"] == {}


def test_families_are_counted_at_their_place(outcome_like: Callable[..., Outcome]) -> None:
    rows = summary(
        [
            outcome_like(families=("memory",), family_right=True, family_probability=0.8),
            outcome_like(families=("memory",), family_right=False, family_probability=0.2),
            outcome_like(),
        ]
    )["families"]
    assert list(rows) == ["all", "memory"]
    assert (rows["memory"]["right"]["count"], rows["memory"]["right"]["total"]) == (1, 2)
    assert rows["all"]["probability"] == 0.5
