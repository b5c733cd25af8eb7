"""The package's calibration is what `make calibrate` makes of the table of training trials."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from rigsight.diagnose.verdict.calibration import trained
from rigsight_bench.scoring.training_trial import training_trial

STUDY = Path(__file__).parents[2] / "experiments/calibration"
MODULES = ("fit", "judged", "table")
FRICTION, PLAY, SPRING = "coulomb_friction", "free_play", "cubic_stiffness"
KEY = {
    "schema_version": 2, "design": "small", "seed": 202, "trial": 7, "kind": "single", "effects": [FRICTION],
    "where": ["dynamics"], "rig": "axis", "noise": "low", "gap": 9.0,
}  # fmt: skip
JUDGING_SEEDS = range(200, 300)
"""Seeds of the bench on which stated probabilities are judged: none of them may train."""


@pytest.fixture
def study(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The command of the study, as its own folder imports it."""
    monkeypatch.syspath_prepend(str(STUDY))
    import fit

    yield fit
    for name in MODULES:
        sys.modules.pop(name, None)


@pytest.mark.slow
def test_the_table_gives_the_calibration_of_the_package(study: ModuleType) -> None:
    trials = [trial for trial in study.read_table() if study.is_judgeable(trial)]
    found, kept = study.calibrated(trials), trained()
    assert found.n_trials == kept.n_trials
    assert found.least_probability == pytest.approx(kept.least_probability, abs=1e-3)
    for now, then in ((found.listed, kept.listed), (found.first, kept.first)):
        assert now == pytest.approx(dict(then), abs=2e-3)


@pytest.mark.slow
def test_sets_contain_the_cause_in_nine_of_ten_trials_by_weight(study: ModuleType) -> None:
    trials = [trial for trial in study.read_table() if study.is_judgeable(trial)]
    unseen, weights = study.probabilities_unseen(trials), study.weights_of(trials)
    covered = unseen >= study.calibrated(trials).least_probability - 1e-4
    assert 0.9 <= np.average(covered, weights=weights) < 0.92


def test_no_seed_that_judges_is_in_the_table(study: ModuleType) -> None:
    assert not {trial.seed for trial in study.read_table()} & set(JUDGING_SEEDS)


def test_a_table_reads_back_as_it_was_written(study: ModuleType, tmp_path: Path) -> None:
    from table import write_table

    trials = study.read_table()
    write_table(trials, tmp_path / "again.csv")
    assert study.read_table(tmp_path / "again.csv") == trials


def test_trials_that_judge_are_of_no_seed_that_trains(study: ModuleType) -> None:
    import judged

    training = {trial.seed for trial in study.read_table()}
    lines = [line for file in judged.FOLDER.glob("*.jsonl") for line in judged.read_lines(file)]
    assert lines
    assert not {line["key"]["seed"] for line in lines} & training


def test_a_trial_scores_with_any_calibration(study: ModuleType, tmp_path: Path) -> None:
    import judged

    (line,) = judged.with_benches([], [bench_of(tmp_path, diagnosed({FRICTION: 0.9, PLAY: 0.1}))])
    doubting = replace(trained(), listed={**trained().listed, "intercept": -30.0})
    sure, unsure = (judged.scored(line, calibration) for calibration in (trained(), doubting))
    assert sure.right
    assert unsure.right
    assert sure.stated > 0.5
    assert unsure.stated == pytest.approx(0.0, abs=1e-6)
    assert judged.tables([sure, unsure]).count("\n") > 10


def diagnosed(shares: dict[str, float]) -> dict[str, Any]:
    """Return what ``diagnosis.json`` has of the first effect named, with a share of the ranking for each."""
    models = {(name,): share for name, share in shares.items()} | {(): None}
    return {
        "verdict": "effect",
        "effects": [next(iter(shares))],
        "where": ["dynamics"],
        "ambiguous_with": [],
        "adequate": True,
        "likely_causes": {"effects": [], "outside": False},
        "candidates": [
            {
                "effects": list(names),
                "where": ["dynamics"] * len(names),
                "probability": 0.0,
                "error_over_noise": 1.0 if names else 9.0,
                "ranking_share": share,
            }
            for names, share in models.items()
        ],
        "noise_floor": {"x": {"lower_bound": False}},
        "gap_by_place": [],
    }


def bench_of(folder: Path, diagnosis: dict[str, Any]) -> Path:
    for path, content in {
        "keys/007.json": KEY,
        "results/007/run.json": {"seconds": 12.0, "message": ""},
        "results/007/diagnosis.json": diagnosis,
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(json.dumps(content), encoding="utf-8")
    return folder


@pytest.mark.parametrize("behind", [0.2, 2e-5, 1e-9])
def test_a_shortened_line_has_the_probabilities_that_the_diagnosis_states(
    study: ModuleType, tmp_path: Path, behind: float
) -> None:
    import judged

    shares = {FRICTION: 1.0 - 2.0 * behind, PLAY: behind, SPRING: behind}
    whole = diagnosed(shares)
    (line,) = judged.with_benches([], [bench_of(tmp_path, whole)])
    situation = training_trial(KEY, whole).situation
    stated = trained().probabilities(situation, list(shares.values()))
    found = judged.scored(line, trained())
    assert found.stated == pytest.approx(stated[0], rel=1e-4)
    reported = judged.with_probabilities(line["diagnosis"], line["key"], trained())
    outside = 1.0 - trained().probability_listed(situation)
    assert 1.0 - sum(c["probability"] for c in reported["candidates"]) >= outside - 1e-9


def test_the_first_outcome_of_a_trial_counts(study: ModuleType, tmp_path: Path) -> None:
    import judged

    first = judged.with_benches([], [bench_of(tmp_path / "a", diagnosed({PLAY: 1.0}))])
    again = bench_of(tmp_path / "b", diagnosed({FRICTION: 1.0}))
    assert judged.with_benches(first, [again]) == first
    with pytest.raises(SystemExit, match="has no trials"):
        judged.with_benches(first, [tmp_path / "nowhere"])
