"""What a check says of an axis whose parameters, faults and pairs of effects are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.check import Check
from rigsight.check.campaign_check import check_campaign
from rigsight.effects import CATALOGUE, effect_named
from rigsight.identify import OFFSETS_MEND
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.read_campaign import campaign_of_records
from rigsight.workflow.own.own_effects import candidates_of

from .axis_records import DT, campaign, swept

SOME = ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "input_delay", "actuator_lag")


def check(own: Campaign, names: tuple[str, ...] = SOME) -> Check:
    return check_campaign(own, candidates_of(own, [effect_named(name) for name in names]), lambda _: None)


def told(found: Check, first: str, second: str) -> str:
    names = found.matrix.effects
    return found.matrix.told[names.index(first)][names.index(second)]


@pytest.fixture(scope="module")
def both_ways() -> Check:
    return check(campaign(swept(), swept(30.0)))


def test_parameters_that_the_records_determine_and_those_that_act_together(both_ways: Check) -> None:
    status = {p.name: p.status for p in both_ways.parameters}
    assert [status[name] for name in ("m", "d", "k")] == ["determined"] * 3
    assert status["x_off"] == status["force_off"] == "only with others"


def test_numbers_given_far_off_leave_the_parameters_as_determined_as_they_are(both_ways: Check) -> None:
    own = campaign(swept(), swept(30.0))
    off = {**own.given, "m": 0.2, "d": 120.0, "k": 80.0}
    errors, near = (
        {p.name: p.relative_error for p in found.parameters}
        for found in (check(replace(own, parameters=off)), both_ways)
    )
    assert all(errors[name] == pytest.approx(near[name], rel=0.1) for name in ("m", "d", "k"))


def test_what_no_numbers_reproduce_is_not_said_to_be_determined_or_not(both_ways: Check) -> None:
    own = campaign(swept(), swept(30.0))
    turned = tuple(record.with_signals(x=-record["x"]) for record in own.records)
    assert "100% of x unexplained" in check(replace(own, records=turned)).identifiability
    assert "unexplained" not in both_ways.identifiability


def test_laws_that_push_differently_are_told_apart_and_a_short_delay_is_a_lag(both_ways: Check) -> None:
    assert told(both_ways, "coulomb_friction", "quadratic_damping") == "apart"
    assert told(both_ways, "coulomb_friction", "cubic_stiffness") == "apart"
    assert told(both_ways, "input_delay", "actuator_lag") == "alike"


def test_no_motion_of_a_linear_rig_tells_where_its_delay_is() -> None:
    own = campaign(swept(n=1500), swept(30.0, n=1500))
    found = check(own, ("input_delay", "sensor_delay", "coulomb_friction"))
    assert told(found, "input_delay", "sensor_delay") == "alike"
    assert told(found, "input_delay", "coulomb_friction") == "apart"


@pytest.mark.parametrize("noise", [0.0, 2e-3])
def test_neither_the_ends_of_a_record_nor_noise_tell_where_a_delay_is(noise: float) -> None:
    rng = np.random.default_rng(1)
    own = campaign(swept(), swept(30.0))
    cut = [record.slice(700, 2200) for record in own.records]
    cut = [r.with_signals(x=r["x"] + noise * rng.standard_normal(r.n_samples)) for r in cut]
    found = check(replace(own, records=tuple(cut)), ("input_delay", "sensor_delay", "time_shift"))
    assert told(found, "input_delay", "sensor_delay") == "alike"
    assert told(found, "input_delay", "time_shift") == "alike"


def test_a_second_sensor_tells_where_a_delay_is() -> None:
    numbers = {"J_m": 1e-3, "J_l": 4e-3, "k_s": 2.0, "d_s": 2e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
    rig, records = RIGS["drive_train"], []
    for i, u in enumerate((swept(3.0, n=1500), swept(9.0, n=1500))):
        run = Record(f"run {i}", DT, {"u": u}, {})
        records.append(simulate(compose(rig), {**numbers, "k_t": 0.05}, run))
    found = check(
        Campaign("drive train", rig, {"k_t": 0.05}, numbers, tuple(records)), ("input_delay", "sensor_delay")
    )
    late, *others = found.matrix.effects  # in the order of the catalogue
    assert [told(found, late, other) for other in others] == ["apart", "apart"]


def test_friction_shows_only_in_a_motion_in_both_directions() -> None:
    # The mass rises all the time: dry friction is a constant force.
    t = DT * np.arange(3000)
    found = check(
        campaign(40.0 * t + 5.0 * np.sin(2.0 * np.pi * 0.5 * t)), ("coulomb_friction", "cubic_stiffness")
    )
    names = found.matrix.effects
    assert found.matrix.visible[names.index("coulomb_friction")] == "no"
    assert told(found, "coulomb_friction", "cubic_stiffness") == "other motion"


def test_the_whole_catalogue_gives_json_without_numbers_that_json_lacks(both_ways: Check) -> None:
    found = check(campaign(), tuple(effect.name for effect in CATALOGUE))
    content = json.loads(json.dumps(found.to_json(), allow_nan=False))
    judged = [entry["effect"] for entry in content["effects"]["judged"]]
    assert "flexible_mode" in content["effects"]["not_judged"]
    assert [len(row) for row in content["effects"]["told_apart"]] == [len(judged)] * len(judged)


def severities(found: Check, signal: str | None) -> list[str]:
    return [remark.severity for remark in found.remarks if remark.signal == signal]


def test_a_record_in_another_unit_is_a_warning() -> None:
    own = campaign(swept(), swept(30.0))
    records = [own.records[0], own.records[1].with_signals(x=1e3 * own.records[1]["x"])]
    read = campaign_of_records("axis", own.rig, own.constants, own.given, records, (), "shared")
    (found,) = (one for one in check(read, ()).remarks if "another unit" in one.sentence)
    assert (found.severity, found.sentence[:2]) == ("warning", "At")


@pytest.mark.parametrize(("zero", "severity"), [(0.004, "warning"), (5.0, "fault")])
def test_a_sensor_that_was_zeroed_between_records_is_told(zero: float, severity: str) -> None:
    own = campaign(swept(), swept(30.0))
    records = (own.records[0], own.records[1].with_signals(x=zero + own.records[1]["x"]))
    offsets = [
        one.severity for one in check(replace(own, records=records), ()).remarks if one.remedy == OFFSETS_MEND
    ]
    assert offsets == [severity]


def test_the_records_of_one_zero_have_no_offsets(both_ways: Check) -> None:
    assert OFFSETS_MEND not in {one.remedy for one in both_ways.remarks}


def moving_against(found: Check) -> list[str | None]:
    return [one.record for one in found.remarks if "opposite sign" in one.sentence]


@pytest.mark.parametrize("turned", [(), (1,), (0, 1)])
def test_records_with_a_reversed_signal_are_faults(turned: tuple[int, ...]) -> None:
    own = campaign(swept(), swept(30.0), effect="coulomb_friction", T_c=2.0)
    records = [r.with_signals(x=-r["x"]) if i in turned else r for i, r in enumerate(own.records)]
    validation = replace(records[1], role="validation")
    found = check(replace(own, records=(records[0], validation)), ())
    assert moving_against(found) == [own.records[i].name for i in turned]


def test_an_unstable_rig_and_a_loop_that_holds_it_have_no_reversed_signal() -> None:
    own = campaign()
    unstable = replace(own, parameters={**own.parameters, "k": -30.0, "d": 5.0})
    assert moving_against(check(replace(unstable, records=(held_by_a_loop(),)), ())) == []


def test_a_controller_that_rejects_disturbances_does_not_reverse_a_signal() -> None:
    own, rng, n = campaign(), np.random.default_rng(0), 4000
    x, v, u = np.zeros(n), 0.0, np.zeros(n)
    push = np.convolve(rng.standard_normal(n), np.ones(40) / 40.0, "same")
    for i in range(1, n):
        u[i] = -2000.0 * x[i - 1] - 60.0 * v
        v += DT * (u[i] + 20.0 * push[i] - 12.0 * v - 800.0 * x[i - 1]) / 2.0
        x[i] = x[i - 1] + DT * v
    record = Record("held", DT, {"u": u, "x": x + 2e-5 * rng.standard_normal(n)}, {})
    assert moving_against(check(replace(own, records=(record,)), ())) == []


def test_a_noisy_input_is_a_warning_and_a_clean_one_is_not(both_ways: Check) -> None:
    own = campaign()
    rng = np.random.default_rng(3)
    noisy = [r.with_signals(u=r["u"] + rng.standard_normal(r.n_samples)) for r in own.records]
    assert "warning" in severities(check(replace(own, records=tuple(noisy))), "u")
    assert "warning" not in severities(both_ways, "u")


def free(damping: float) -> Campaign:
    t = DT * np.arange(2000)
    x = 0.01 * np.exp(-damping * t) * np.cos(20.0 * t)
    record = Record(
        "free",
        DT,
        {"u": np.zeros(t.size), "x": x + 1e-6 * np.random.default_rng(0).standard_normal(t.size)},
        {},
    )
    return replace(campaign(), records=(record,))


def test_a_free_motion_that_does_not_decay_is_a_warning() -> None:
    assert "warning" in severities(check(free(-0.01)), "x")
    assert "warning" not in severities(check(free(0.05)), "x")


@pytest.mark.parametrize("phase", [1.94, 2.33, 2.71])
def test_a_slow_decay_is_seen_wherever_the_record_is_cut(phase: float) -> None:
    t = 0.01 * np.arange(500)
    x = 0.07 * np.exp(-0.02 * t) * np.cos(8.48 * t + phase)
    record = Record("swings", 0.01, {"u": np.zeros(t.size), "x": x}, {})
    assert "warning" not in severities(check(replace(campaign(), records=(record,))), "x")


def test_noise_around_zero_at_the_end_of_a_decay_is_no_motion_that_lasts() -> None:
    t = 0.1 * np.arange(1000)
    x = 0.285 * np.exp(-0.02 * t) * np.cos(0.45 * t) + 0.002 * np.random.default_rng(0).standard_normal(
        t.size
    )
    record = Record("blow", 0.1, {"u": np.zeros(t.size), "x": x}, {})
    assert "warning" not in severities(check(replace(campaign(), records=(record,))), "x")


def test_an_unstable_rig_is_a_warning_and_its_parameters_are_known_all_the_same() -> None:
    own = campaign()
    unstable = replace(own, parameters={**own.parameters, "k": -30.0, "d": 5.0})
    found = check(replace(unstable, records=(held_by_a_loop(),)))
    assert any(remark.severity == "warning" and "pole" in remark.sentence for remark in found.remarks)
    assert {p.name: p.status for p in found.parameters}["m"] == "determined"


def held_by_a_loop() -> Record:
    """Return an unstable mass under a controller."""
    n, x, v = 3000, 0.0, 0.0
    goal = 0.01 * np.sin(np.cumsum(np.linspace(0.01, 0.1, n)))
    u, reading = np.zeros(n), np.zeros(n)
    for i in range(n):
        reading[i], u[i] = x, 2000.0 * (goal[i] - x) - 60.0 * v
        for _ in range(10):
            v += 0.1 * DT * (u[i] - 5.0 * v + 30.0 * x) / 2.0
            x += 0.1 * DT * v
    return Record("held", DT, {"u": u, "x": reading, "reference": goal}, {}, hold="zoh")
