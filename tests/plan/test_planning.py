"""A planned experiment separates rivals that one record left open, keeps the limits, and can be played and read again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.check.campaign_check import check_campaign
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.plan import Named
from rigsight.plan.experiments import read_limits, read_payloads, use_of
from rigsight.plan.planning import Plan, plan_experiment
from rigsight.plan.rivals import contest_of
from rigsight.plan.search import about, posterior, refitted
from rigsight.plan.usual_sizes import truths_of_usual_size
from rigsight.records import Record
from rigsight.records.read_record import ReadingOptions, read_record
from rigsight.report.plan import promise
from rigsight.rigs import AXIS, read_rig_file
from rigsight.simulate import compose, simulate
from rigsight.workflow.run.results import csv_text

DT, NOISE = 0.01, 1e-5
VALUES = {"gain": 1.0, "m": 2.0, "d": 12.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.01}
PAIR = [Named((effect_named(name),)) for name in ("coulomb_friction", "quadratic_damping")]
HOIST = """
name = "hoist"
summary = "A mass that lifts a payload against a spring."
[inputs.force]
unit = "N"
[constants.payload]
unit = "kg"
lower = 0.0
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[coordinates.h]
unit = "m"
[energy]
kinetic = "(m + payload)*d(h)^2/2"
potential = "9.81*payload*h"
[joints.guide]
motion = "h"
stiffness = "k"
damping = "d"
[drives.motor]
signal = "force"
force = "motor"
along = "h"
[sensors.x]
reads = "h"
unit = "m"
"""
LIMITS = ["u=3", "x=0.004", "d(x)=0.05"]


def moved(record: Record) -> Record:
    """Return the readings of an axis with dry friction."""
    return simulate(compose(AXIS, [effect_named("coulomb_friction")]), VALUES, record)


def measured(record: Record, seed: int) -> Record:
    """Return the same with noise."""
    run = moved(record)
    noise = np.random.default_rng(seed).normal(scale=NOISE, size=run.n_samples)
    return run.with_signals(x=run["x"] + noise)


@pytest.fixture(scope="module")
def one_amplitude() -> Campaign:
    """An axis with dry friction that moved at one amplitude only: more damping looks nearly the same."""
    t = DT * np.arange(600)
    first = measured(Record("first", DT, {"u": 0.8 * np.sin(20.0 * t)}, {}), 0)
    given = {name: VALUES[name] for name in ("m", "d", "k", "x_off", "force_off")}
    return Campaign("axis", AXIS, {"gain": 1.0}, given, (first,))


@pytest.fixture(scope="module")
def plan(one_amplitude: Campaign) -> Plan:
    return plan_experiment(one_amplitude, PAIR, read_limits(AXIS, LIMITS), 6.0, 0, lambda _: None, draws=1)


def test_the_record_separates_rivals_much_better_than_the_old_one_repeated(
    one_amplitude: Campaign, plan: Plan
) -> None:
    contest = contest_of(one_amplitude, PAIR, lambda _: None)
    wrong = next(rival for rival in contest.rivals if rival.label == "quadratic_damping")
    (first,) = one_amplitude.records
    assert contest.rivals[0].probability < 0.8
    assert about(contest, wrong, moved(plan.record)) > 10.0 * about(contest, wrong, moved(first))


def test_the_measured_record_decides_for_the_truth(one_amplitude: Campaign, plan: Plan) -> None:
    new = replace(measured(plan.record, 2), name="plan")
    after = contest_of(replace(one_amplitude, records=(*one_amplitude.records, new)), PAIR, lambda _: None)
    assert after.rivals[0].label == "coulomb_friction"
    assert after.rivals[0].probability > 0.95


def test_limits_are_kept_in_the_simulations_of_all_rivals(plan: Plan) -> None:
    limits = read_limits(AXIS, LIMITS)
    assert [limit.name for limit, _ in plan.limits] == ["u", "x", "d(x)"]
    assert all(use_of(limits, one.readings) <= 1.0 for one in plan.rivals)
    assert all(largest <= limit.value for limit, largest in plan.limits)


def test_the_promise_is_a_probability_that_simulations_keep(plan: Plan) -> None:
    assert plan.rivals[0].probability < plan.promised <= plan.trials.expected <= 0.97
    assert plan.trials.n == 2
    json.dumps(plan.to_json(), allow_nan=False)


@pytest.mark.parametrize(
    ("now", "promised", "decided", "told"),
    [
        (0.94, 0.97, 1.0, "Expected probability"),
        (0.97, 0.97, 1.0, "The records decide between these rivals already."),
        (0.6, 0.62, 0.0, "No record within these limits tells these rivals apart."),
        (0.6, 0.9, 0.4, "Expected probability"),
    ],
)
def test_the_promise_says_what_its_numbers_say(
    plan: Plan, now: float, promised: float, decided: float, told: str
) -> None:
    trials = replace(plan.trials, expected=promised, decided=decided)
    assert promise(replace(plan, now=now, without_noise=1.0, trials=trials)).startswith(told)


def test_the_same_seed_gives_the_same_plan(one_amplitude: Campaign, plan: Plan) -> None:
    again = plan_experiment(one_amplitude, PAIR, read_limits(AXIS, LIMITS), 6.0, 0, lambda _: None, draws=1)
    assert np.array_equal(again.record["u"], plan.record["u"])


def test_the_file_to_play_is_read_as_a_record(plan: Plan, tmp_path: Path) -> None:
    file = tmp_path / "plan.csv"
    file.write_text(csv_text(plan.record, ["u"]))
    read = read_record(file, AXIS.inputs, AXIS.outputs, ReadingOptions(require_outputs=False))
    assert read.dt == pytest.approx(DT)
    assert read["u"] == pytest.approx(plan.record["u"], abs=1e-9)


@pytest.mark.parametrize("text", ["y=1", "x", "x=-1", "d(u)=nan"])
def test_a_limit_that_cannot_be_used_is_refused_with_those_allowed(text: str) -> None:
    with pytest.raises(InputError, match=r"--limit"):
        read_limits(AXIS, [text])
    with pytest.raises(InputError, match=r"u, d\(u\), x, d\(x\), gain"):
        read_limits(AXIS, ["y=1"])


def test_a_constant_may_have_several_values_within_its_range() -> None:
    asked = ["u=3", "gain=2", "gain=4"]
    assert read_payloads(AXIS, asked) == ({"gain": 2.0}, {"gain": 4.0})
    assert [limit.name for limit in read_limits(AXIS, asked)] == ["u"]
    with pytest.raises(InputError, match="gain"):
        read_payloads(AXIS, ["gain=inf"])
    with pytest.raises(InputError, match="gain"):
        read_payloads(AXIS, ["gain=two"])


def test_before_records_rivals_have_a_size_and_none_is_more_probable(one_amplitude: Campaign) -> None:
    truths = truths_of_usual_size(one_amplitude, PAIR, 600, False, lambda _: None)
    for truth, name in zip(truths, ("T_c", "c_2"), strict=True):
        assert truth.rival.fit.values[name] > 0.0
        assert (truth.contest.records, truth.weight) == ((), 0.5)
        assert [rival.probability for rival in truth.contest.rivals] == [0.5, 0.5]
        assert truth.drawn(np.random.default_rng(0)).rival.fit.values["d"] > 0.0


def test_before_records_no_effect_is_fitted_as_any_other_rival(one_amplitude: Campaign) -> None:
    truths = truths_of_usual_size(one_amplitude, [Named(()), PAIR[0]], 600, False, lambda _: None)
    (first,) = one_amplitude.records
    contest = truths[0].contest
    for rival in contest.rivals:
        assert rival.fit.initial_states == ()
        assert np.isfinite(refitted(contest, rival, first, contest.remainder.errors(first)).against)


def test_beside_records_what_laws_err_by_leaves_effects_of_a_usual_size_open(one_amplitude: Campaign) -> None:
    truths = truths_of_usual_size(one_amplitude, PAIR, 600, True, lambda _: None)
    (first,) = one_amplitude.records
    for truth in truths:
        assert len(truth.contest.records) == 1
        assert truth.contest.rivals[truth.index].probability < 0.9
        wrong = next(rival for rival in truth.contest.rivals if rival.label != truth.rival.label)
        again = simulate(truth.rival.fit.structure, truth.rival.fit.values, first)
        assert about(truth.contest, wrong, again) < 3.0


@pytest.mark.slow
def test_a_payload_is_taken_where_friction_depends_on_the_load(tmp_path: Path) -> None:
    (tmp_path / "hoist.toml").write_text(HOIST)
    rig = read_rig_file(tmp_path / "hoist.toml")
    pair = [Named((effect_named(name),)) for name in ("coulomb_friction", "load_dependent_friction")]
    t = DT * np.arange(600)
    inputs = {"force": 6.0 * np.sin(8.0 * t)}
    values = {"m": 2.0, "k": 200.0, "d": 12.0, "payload": 0.0}
    record = simulate(compose(rig), values, Record("first", DT, inputs, {}))
    noise = np.random.default_rng(0).normal(scale=NOISE, size=t.size)
    own = Campaign("hoist", rig, {"payload": 0.0}, values, (record.with_signals(x=record["x"] + noise),))
    asked = ["force=60", "payload=3"]
    payloads = read_payloads(rig, asked)
    found = plan_experiment(
        own, pair, read_limits(rig, asked), 6.0, 0, lambda _: None, 1, sizes="usual", payloads=payloads
    )
    # Both the record without a payload and the one with it were tried.
    assert found.record.constants == {"payload": 3.0}


@pytest.mark.slow
def test_what_a_motion_hides_the_planned_record_shows() -> None:
    """A mass that rises all the time: dry friction is a constant force."""
    t = DT * np.arange(3000)
    first = measured(Record("first", DT, {"u": 40.0 * t + 5.0 * np.sin(np.pi * t)}, {}), 0)
    given = {name: VALUES[name] for name in ("m", "d", "k", "x_off", "force_off")}
    own = Campaign("axis", AXIS, {"gain": 1.0}, given, (first,))
    pair = [Named((effect_named("coulomb_friction"),)), Named(())]

    def visible(campaign: Campaign) -> tuple[str, ...]:
        return check_campaign(campaign, [effect_named("coulomb_friction")], lambda _: None).matrix.visible

    found = plan_experiment(
        own, pair, read_limits(AXIS, ["u=1500"]), 6.0, 0, lambda _: None, 1, sizes="usual"
    )
    after = replace(own, records=(first, replace(measured(found.record, 1), name="plan")))
    assert (visible(own), visible(after)) == (("no",), ("yes",))


def test_limits_that_no_experiment_keeps_are_refused(one_amplitude: Campaign) -> None:
    with pytest.raises(InputError, match="No experiment keeps the limits"):
        plan_experiment(one_amplitude, PAIR, read_limits(AXIS, ["x=1e-12"]), 6.0, 0, lambda _: None)


def test_no_probability_exceeds_that_of_a_verdict() -> None:
    assert posterior([0.5, 0.5], [0.0, 1e6]) == pytest.approx([0.97, 0.0])
    assert posterior([0.5, 0.5], [np.inf, np.inf]) == pytest.approx([0.5, 0.5])
