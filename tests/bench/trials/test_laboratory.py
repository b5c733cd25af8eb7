"""Each condition of the laboratory does to the records what it is called after, and no more; all conditions come in turn."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import welch

from rigsight.effects import kind_of
from rigsight.records import Record
from rigsight.simulate import compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench.running.files import BenchFolder
from rigsight_bench.trials import n_trials
from rigsight_bench.trials.counted import COUNTED_EFFECTS
from rigsight_bench.trials.laboratory import subjects
from rigsight_bench.trials.laboratory.bench import LaboratoryBench
from rigsight_bench.trials.laboratory.channels import in_steps, sampled
from rigsight_bench.trials.laboratory.stands import (
    STANDS,
    WARMTH,
    Softening,
    draw_law,
    wired_numbers,
    wired_rig,
)
from rigsight_bench.trials.laboratory.subjects import (
    CONDITIONS,
    FAMILIES,
    NEVER,
    LaboratorySubject,
    draw_laboratory_effects,
    effects_shown,
    laboratory_cells,
    laboratory_subject_of,
)
from rigsight_bench.trials.laboratory.trial import draw_bench, draw_laboratory_trial, handed
from rigsight_bench.trials.waveforms import PlannedMoves, samples

SEED = 7


@cache
def taken(condition: subjects.Condition, stand: str) -> tuple[LaboratoryBench, tuple[Record, ...]]:
    """Return a bench without hidden effects and its records, as a diagnosis would get them."""
    rig, around, noise = (np.random.default_rng([SEED, i]) for i in range(3))
    bench = draw_bench(LaboratorySubject(condition, stand, ()), rig, around)
    seen = [bench.measured((), {}, run, i, noise) for i, run in enumerate(bench.runs)]
    return bench, tuple(handed(bench, seen, np.random.default_rng(SEED)))


def quiet(bench: LaboratoryBench) -> list[Record]:
    return [bench.quiet((), {}, run) for run in bench.runs]


def test_a_stand_that_does_not_oscillate_has_a_stable_position_loop() -> None:
    stand = STANDS["running_gear"]
    values = {**stand.draw_numbers(np.random.default_rng(SEED)), "k_d": 1e3}
    assert not np.any(linearize(compose(stand.rig), values).poles.imag)
    law = draw_law(stand, values, np.random.default_rng(SEED))
    wired = {**values, **wired_numbers(law, None)}
    assert linearize(compose(wired_rig(stand.rig, law, None)), wired).stability == "stable"


@pytest.mark.parametrize("n", [10, 20, 35, 60])
def test_any_first_trials_hold_all_conditions_evenly(n: int) -> None:
    counts = Counter(laboratory_subject_of(SEED, number).condition for number in range(n))
    assert set(counts) == set(CONDITIONS)
    assert max(counts.values()) - min(counts.values()) <= 1


def test_a_pass_takes_every_cell_once() -> None:
    drawn = [laboratory_subject_of(SEED, number) for number in range(n_trials("laboratory"))]
    assert Counter(drawn) == Counter(laboratory_cells())
    assert drawn != [laboratory_subject_of(SEED + 1, number) for number in range(n_trials("laboratory"))]


def test_every_counted_effect_is_hidden_somewhere() -> None:
    hidden = {
        kind_of(effect.name)
        for cell in laboratory_cells()
        for family in cell.families
        for effect in effects_shown(STANDS[cell.stand], family)
    }
    assert hidden == {*COUNTED_EFFECTS} - NEVER
    assert sorted(name for family in (*FAMILIES.values(), NEVER) for name in family) == sorted(
        COUNTED_EFFECTS
    )


def test_one_effect_of_each_family_is_drawn_and_any_may_be_the_main_one() -> None:
    cell = next(cell for cell in laboratory_cells() if len(cell.families) == 3)
    drawn = [draw_laboratory_effects(cell, np.random.default_rng(i)) for i in range(20)]
    family = {law: name for name, laws in FAMILIES.items() for law in laws}
    for effects in drawn:
        assert sorted(family[kind_of(e.name)] for e in effects) == sorted(cell.families)
    assert {family[kind_of(effects[0].name)] for effects in drawn} == set(cell.families)


@pytest.mark.slow
def test_a_wired_rig_that_nothing_touches_moves_as_the_rig_itself() -> None:
    bench, _ = taken("clean", "drive_train")
    run = bench.runs[1]
    itself = simulate(compose(bench.rig), bench.values, run.record(finer=4), accuracy=1e-7)
    for name in ("motor_angle", "load_angle"):
        assert np.allclose(quiet(bench)[1][name], itself[name][::4], atol=1e-6 * np.ptp(itself[name]))


def test_a_joint_that_is_warm_has_lost_what_is_said() -> None:
    stand, lost = STANDS["running_gear"], Softening(0.2, 0.01)
    values = stand.draw_numbers(np.random.default_rng(SEED))
    run = {"u": np.sin(np.linspace(0.0, 30.0, 2000)), "push": np.zeros(2000), WARMTH: np.ones(2000)}
    record = Record(name="warm", dt=5e-3, signals=run, units={})
    warm = simulate(
        compose(wired_rig(stand.rig, None, lost)), {**values, **wired_numbers(None, lost)}, record
    )
    numbers = {**values, "k_d": 0.8 * values["k_d"], "k_c": 0.99 * values["k_c"]}
    expected = simulate(compose(stand.rig), numbers, record)
    assert np.allclose(warm["psi"], expected["psi"], atol=1e-5 * np.ptp(expected["psi"]))


@pytest.mark.slow
def test_clean_records_differ_from_the_motion_by_white_noise_alone() -> None:
    bench, records = taken("clean", "stage")
    for record, motion in zip(records, quiet(bench), strict=True):
        left = record["x"] - motion["x"]
        assert np.array_equal(record["u"], motion["u"])
        assert np.std(left) == pytest.approx(bench.noise["x"], rel=0.1)
        assert abs(np.corrcoef(left[1:], left[:-1])[0, 1]) < 0.1


@pytest.mark.slow
def test_behind_a_filter_noise_rolls_off_and_no_record_begins_at_rest() -> None:
    bench, records = taken("antialias_filter", "stage")
    for record in records:
        assert "step" not in record.kind
        assert np.std(record["u"][:100]) > 0.0
    fine = np.zeros(200_000)
    noise = sampled(fine, 4, bench.around.filter_corner, 1.0, np.random.default_rng(SEED))
    assert np.std(noise) == pytest.approx(1.0, rel=0.02)
    frequency, power = welch(noise, fs=2.0, nperseg=512)
    passed = power[frequency < 0.5 * bench.around.filter_corner].mean()
    assert power[frequency > 0.95].mean() < 0.2 * passed


def test_a_filter_leaves_what_is_slow_and_begins_settled() -> None:
    slow = 3.0 + np.sin(np.linspace(0.0, 2.0, 8000))
    rng = np.random.default_rng(SEED)
    assert np.allclose(sampled(slow, 4, 0.5, 0.0, rng), slow[::4], atol=1e-2)


@pytest.mark.slow
def test_feedback_is_measured_with_noise_on_the_input_and_a_force_moves_the_rig() -> None:
    bench, records = taken("feedback", "joint")
    assert bench.around.law is not None
    assert all(set(record.signals) == {"u", "x"} for record in records)
    for record, motion in zip(records, quiet(bench), strict=True):
        noise = bench.around.input_noise * bench.sizes["u"]
        assert np.std(np.diff(record["u"] - motion["u"])) == pytest.approx(np.sqrt(2.0) * noise, rel=0.2)
        assert np.std(record["x"] - motion["x"]) > bench.noise["x"]


def test_between_samples_the_input_of_a_loop_is_as_its_record_holds_it() -> None:
    bench, _ = taken("feedback", "joint")
    for motion, run in zip(quiet(bench), bench.runs, strict=True):
        itself = bench.floor((), {}, [motion])["x"]
        assert itself == pytest.approx(bench.noise["x"]), run.kind
    assert {run.kind for run in bench.runs} == {"sweep", "multisine", "operation"}


def test_a_planned_move_begins_and_ends_at_rest() -> None:
    moves = PlannedMoves(0.2, start=1.0, length=0.5)
    t = np.linspace(0.0, 5.0, 5001)
    goal = samples(moves, t)
    assert goal[[0, 1000, 1500, 2000, 2500, 3000, 3500]] == pytest.approx(
        [0, 0, 0.2, 0.2, -0.2, -0.2, 0], abs=1e-9
    )
    assert np.max(np.abs(np.diff(goal, 2))) < 1e-5
    assert np.all(goal[3501:] == 0.0)


def test_a_loop_brings_a_joint_to_its_goal() -> None:
    bench, _ = taken("feedback", "joint")
    law = bench.around.law
    found = linearize(compose(wired_rig(bench.rig, law, None)), {**bench.values, **wired_numbers(law, None)})
    assert found.stability == "stable"
    column = found.inputs.index("goal")
    assert np.real(found.frequency_response(np.zeros(1))[0, 0, column]) == pytest.approx(1.0)


@pytest.mark.slow
def test_repeats_have_one_input_but_for_the_noise_of_its_sensor() -> None:
    bench, records = taken("repeats", "stage")
    noise = bench.around.input_noise * bench.sizes["u"]
    for one, other in ((2, 3), (4, 6)):
        assert records[one].role == records[other].role
        difference = records[one]["u"] - records[other]["u"]
        assert np.std(difference) == pytest.approx(np.sqrt(2.0) * noise, rel=0.1)
        assert np.std(records[one]["x"] - records[other]["x"]) > 0.0


@pytest.mark.slow
def test_under_stiction_a_force_from_outside_is_a_share_of_that_of_the_drive() -> None:
    bench, records = taken("stiction", "element")
    assert 5e-3 <= bench.around.push <= 5e-2
    for record, motion in zip(records, quiet(bench), strict=True):
        # What pushes an element adds to its force.
        outside = np.hypot(bench.around.push * np.std(motion["force"]), bench.noise["force"])
        assert np.std(record["force"] - motion["force"]) == pytest.approx(outside, rel=0.4)


def test_a_force_from_outside_moves_a_stage() -> None:
    bench, records = taken("stiction", "stage")
    for record, motion in zip(records, quiet(bench), strict=True):
        left = record["x"] - motion["x"]
        # White noise alone stays below this, as of the clean records.
        assert np.corrcoef(left[1:], left[:-1])[0, 1] > 0.1
        assert np.array_equal(record["u"], motion["u"])


def test_an_encoder_shows_whole_steps() -> None:
    bench, records = taken("encoder", "stage")
    step = bench.around.step * bench.sizes["x"]
    assert 100.0 <= 2.0 * bench.sizes["x"] / step <= 2000.0
    for record in records:
        steps = record["x"] / step
        assert np.allclose(steps, np.round(steps), atol=1e-6)
        assert np.ptp(np.round(steps)) >= 10.0
    assert in_steps(np.array([0.26]), 0.5)[0] == 0.5


@pytest.mark.slow
def test_what_only_decays_has_a_constant_input_or_none_and_begins_away_from_rest() -> None:
    bench, records = taken("free_decay", "arm")
    inputs = [name for name in ("tau_1", "tau_2") if name in records[0]]
    for record in records:
        assert all(np.ptp(record[name]) == 0.0 for name in inputs)
        assert record.amplitude is None
        assert record.kind == "operation"
    begins = [abs(motion["angle_2"][0]) for motion in quiet(bench)]
    assert min(begins) > 3.0 * bench.noise["angle_2"]
    assert max(begins) > 2.0 * min(begins)
    for motion in quiet(bench):
        assert np.ptp(motion["angle_2"][-400:]) < np.ptp(motion["angle_2"][:400])


@pytest.mark.slow
def test_some_loggers_leave_out_the_channel_that_does_not_move() -> None:
    bench, _ = taken("free_decay", "stage")
    handed_over = [handed(bench, quiet(bench)[:1], np.random.default_rng(i))[0] for i in range(10)]
    assert {"u" in record for record in handed_over} == {True, False}


@pytest.mark.slow
def test_offsets_differ_from_record_to_record() -> None:
    bench, records = taken("offsets", "running_gear")
    for name in ("psi", "y"):
        left = [np.mean(r[name] - m[name]) for r, m in zip(records, quiet(bench), strict=True)]
        assert np.ptp(left) > bench.noise[name]
        spread = [np.std(r[name] - m[name]) for r, m in zip(records, quiet(bench), strict=True)]
        assert np.allclose(spread, bench.noise[name], rtol=0.1)


def test_what_drifts_differs_more_from_cold_the_later_it_is_recorded() -> None:
    bench, records = taken("drift", "stage")
    sweeps = [(r, m) for r, m in zip(records, quiet(bench), strict=True) if r.kind == "sweep"]
    left = [np.std(r["x"] - m["x"]) / np.std(m["x"]) for r, m in sweeps]
    assert left[-1] > left[0]


@pytest.mark.slow
@pytest.mark.parametrize("condition", CONDITIONS)
def test_a_condition_does_what_it_is_called_after_and_nothing_else(condition: subjects.Condition) -> None:
    stand = "arm" if condition == "free_decay" else "stage"
    around = asdict(taken(condition, stand)[0].around)
    used = {name for name, value in around.items() if value and name not in ("noise", "push_corner")}
    assert used == {
        "antialias_filter": {"filter_corner"},
        "feedback": {"law", "push", "input_noise"},
        "repeats": {"push", "input_noise"},
        "stiction": {"push"},
        "encoder": {"step"},
        "drift": {"softening", "warms_up"},
        "offsets": {"offset"},
    }.get(condition, set())


@pytest.mark.slow
def test_a_trial_is_the_same_for_the_same_seed_and_its_campaign_holds_nothing_of_the_truth(
    tmp_path: Path,
) -> None:
    wanted = LaboratorySubject("encoder", "joint", ("friction",))
    number = next(n for n in range(n_trials("laboratory")) if laboratory_subject_of(SEED, n) == wanted)
    trial, again = (draw_laboratory_trial(SEED, number) for _ in range(2))
    assert trial.key == again.key
    assert trial.given == again.given
    for one, other in zip(trial.records, again.records, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in one.signals)
    assert trial.key["gap"] >= 5.0

    folder = BenchFolder(tmp_path / "bench")
    folder.settle("laboratory", SEED)
    folder.write_trial("000", trial)
    assert folder.withheld_records("000", trial.rig) == []
    campaign = read_campaign(folder.campaign("000"))
    assert campaign.parameters == trial.given
    assert campaign.parameters["k"] == 0.0
    files = list(folder.campaign("000").iterdir())
    texts = "".join(file.read_text().splitlines()[0] for file in files if file.suffix == ".csv")
    texts += next(file.read_text() for file in files if file.suffix == ".toml")
    for secret in (*trial.key["effects"], trial.key["condition"], "goal", "law", "laboratory"):
        assert secret not in texts
    for name, value in trial.key["values"].items():
        if name not in ("gain", "k", "x_off", "force_off"):
            assert f"{value!r}" not in texts
