"""The package's calibration is what `make calibrate` makes of the table of training trials."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from rigsight.diagnose.verdict.calibration import trained

STUDY = Path(__file__).parents[2] / "experiments/calibration"
MODULES = ("fit", "table")
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


def test_no_seed_that_judges_is_in_the_table(study: ModuleType) -> None:
    assert not {trial.seed for trial in study.read_table()} & set(JUDGING_SEEDS)


def test_a_table_reads_back_as_it_was_written(study: ModuleType, tmp_path: Path) -> None:
    from table import write_table

    trials = study.read_table()
    write_table(trials, tmp_path / "again.csv")
    assert study.read_table(tmp_path / "again.csv") == trials
