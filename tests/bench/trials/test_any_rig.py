"""Rigs of any shape are drawn by their equations alone, and their trials hide effects where the key says."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from rigsight.diagnose.fitting.placed_effects import candidates_on
from rigsight.effects import CATALOGUE
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate
from rigsight.simulate.linearization import linearize
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight_bench.running.files import BenchFolder
from rigsight_bench.trials import any_rig_numbers, n_trials
from rigsight_bench.trials.any_rig_campaign import draw_runs
from rigsight_bench.trials.any_rig_numbers import DAMPING_RATIOS, FREQUENCIES, draw_numbers
from rigsight_bench.trials.any_rig_subjects import draw_effects, placed_cells, placed_subject_of
from rigsight_bench.trials.any_rig_trial import draw_placed_trial
from rigsight_bench.trials.counted import COUNTED_RIGS, counted_effects

SEED = 7


def test_every_counted_rig_and_every_kind_of_its_places_has_cells() -> None:
    cells = placed_cells()
    assert n_trials("rigs") == len(cells)
    for name in COUNTED_RIGS:
        kinds = {effect.place for effect in candidates_on(RIGS[name], counted_effects())}
        assert {c.place for c in cells if c.rig == name and c.kind == "single"} == kinds
    kinds_of_trials = Counter(c.kind for c in cells)
    assert min(kinds_of_trials[kind] for kind in ("pair", "none", "parameters", "outside")) >= 3


def test_a_pass_over_the_cells_takes_each_once() -> None:
    drawn = [placed_subject_of(SEED, number) for number in range(len(placed_cells()))]
    assert Counter(drawn) == Counter(placed_cells())
    assert drawn != list(placed_cells())


def test_what_is_hidden_is_offered_to_the_diagnosis() -> None:
    rng = np.random.default_rng(1)
    for cell in placed_cells():
        rig = RIGS[cell.rig]
        hidden = draw_effects(rig, cell, rng)
        offered = {effect.name for effect in candidates_on(rig, CATALOGUE)}
        if cell.kind == "outside":
            assert not {effect.name for effect in hidden} & offered
            assert all(rig.offers(effect) for effect in hidden)
        else:
            assert {effect.name for effect in hidden} <= offered
        assert len(hidden) == {"single": 1, "pair": 2, "outside": 1}.get(cell.kind, 0)


@pytest.mark.parametrize("name", ["servo", "quarter_car", "element"])
def test_numbers_lie_within_their_bounds_and_the_rig_vibrates_within_its_bands(name: str) -> None:
    rig = RIGS[name]
    values = draw_numbers(rig, np.random.default_rng(3))
    assert all(p.lower <= values[p.name] <= p.upper for p in (*rig.constants, *rig.parameters))
    found = linearize(compose(rig), values)
    assert found.stability != "unstable"
    vibrating = np.abs(found.poles.imag) > 0.0
    assert np.all(found.natural_frequencies[vibrating] >= FREQUENCIES[0])
    assert np.all(found.natural_frequencies[vibrating] <= FREQUENCIES[1])
    assert np.all(found.damping_ratios[vibrating] >= DAMPING_RATIOS[0])
    assert np.all(found.damping_ratios[vibrating] <= DAMPING_RATIOS[1])


def test_no_number_depends_on_what_a_rig_or_its_parameters_are_called() -> None:
    source = Path(any_rig_numbers.__file__).read_text(encoding="utf-8")
    for name, rig in RIGS.items():
        assert f'"{name}"' not in source
        assert not [p.name for p in rig.parameters if f'"{p.name}"' in source]


def test_all_inputs_move_and_a_control_law_is_left_in_its_range_for_most_of_the_time() -> None:
    rig = RIGS["servo"]
    values = draw_numbers(rig, np.random.default_rng(3))
    runs = draw_runs(rig, values, np.random.default_rng(4))
    assert [run.role for run in runs].count(None) == 2
    for run in runs:
        record = run.record()
        shown = simulate(compose(rig), values, record)
        told = values["k_p"] * (record["goal"] - shown["angle"])
        assert np.ptp(record["goal"]) > 0.0
        assert np.mean(np.abs(told) < 1.0) > 0.8


@pytest.mark.slow
def test_a_trial_of_a_drive_train_reads_and_its_gap_is_as_wished(tmp_path: Path) -> None:
    number = next(
        n for n in range(len(placed_cells()))
        if (s := placed_subject_of(SEED, n)).rig == "drive_train" and s.kind == "single"
    )  # fmt: skip
    trial = draw_placed_trial(SEED, number)
    assert trial.key["aimed_gap"] / 2.5 < trial.key["gap"] < 2.5 * trial.key["aimed_gap"]
    assert len(trial.key["where"]) == len(trial.key["effects"]) == 1
    folder = BenchFolder(tmp_path / "bench")
    folder.settle("rigs", SEED)
    folder.write_trial("000", trial)
    campaign = read_campaign(folder.campaign("000"))
    assert campaign.parameters == trial.given
    assert [r.name for r in folder.withheld_records("000", RIGS["drive_train"])]
