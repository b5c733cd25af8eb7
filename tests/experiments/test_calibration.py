"""The package's calibration is what `make calibrate` makes of the table of training trials."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from rigsight.diagnose.verdict.calibration import trained

STUDY = Path(__file__).parents[2] / "experiments/calibration"
MODULES = ("fit", "judged", "table")
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


def test_the_table_gives_the_calibration_of_the_package(study: ModuleType) -> None:
    trials = [trial for trial in study.read_table() if study.is_judgeable(trial)]
    found, kept = study.calibrated(trials), trained()
    assert found.n_trials == kept.n_trials
    assert found.least_probability == pytest.approx(kept.least_probability, abs=1e-3)
    for now, then in ((found.listed, kept.listed), (found.first, kept.first)):
        assert now == pytest.approx(dict(then), abs=2e-3)


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


def test_trials_that_judge_are_of_no_seed_that_trains_and_score_with_any_calibration(
    study: ModuleType,
) -> None:
    import judged

    lines = judged.read_lines()
    assert lines
    training = {trial.seed for trial in study.read_table()}
    assert not {line["key"]["seed"] for line in lines} & training
    doubting = replace(trained(), listed={**trained().listed, "intercept": -30.0})
    for line in lines:
        sure, unsure = (judged.scored(line, calibration) for calibration in (trained(), doubting))
        assert sure.right == unsure.right
        assert unsure.stated == pytest.approx(1.0 if sure.verdict == "unknown" else 0.0, abs=1e-6)
    assert judged.tables([judged.scored(line, trained()) for line in lines]).count("\n") > 10
