"""A diagnosis that was interrupted goes on where it stopped, and comes out the same."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.effects import effect_named
from rigsight.errors import MachineError
from rigsight.workflow.diagnose import FitJournal, run_diagnose
from rigsight.workflow.run.progress import Step

CANDIDATES = [effect_named(name) for name in ("cubic_stiffness", "coulomb_friction")]


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Fits that were recalled, one entry per diagnosis that ended."""
    seen: list[int] = []
    own: set[str] = set()
    recalled: set[str] = set()
    recall, remember, leave = FitJournal.recall, FitJournal.remember, FitJournal.__exit__

    def noted_recall(self: FitJournal, key: str):
        found = recall(self, key)
        if found is not None and key not in own:
            recalled.add(key)
        return found

    def noted_remember(self: FitJournal, key: str, outcome) -> None:
        own.add(key)
        remember(self, key, outcome)

    def noted_exit(self: FitJournal, kind, error, trace) -> None:
        seen.append(len(recalled))
        own.clear()
        recalled.clear()
        leave(self, kind, error, trace)

    monkeypatch.setattr(FitJournal, "recall", noted_recall)
    monkeypatch.setattr(FitJournal, "remember", noted_remember)
    monkeypatch.setattr(FitJournal, "__exit__", noted_exit)
    return seen


@pytest.fixture
def journals(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("rigsight.workflow.diagnose.cache_folder", lambda: tmp_path / "cache")
    return tmp_path / "cache/unfinished"


def diagnosed(campaign: Path, stop_at: str | None = None, said: list[Step] | None = None) -> Diagnosis:
    def listener(step: Step) -> None:
        if said is not None:
            said.append(step)
        if step.detail == stop_at:
            raise KeyboardInterrupt

    return run_diagnose(campaign, None, effects=CANDIDATES, n_jobs=1, listener=listener)


@pytest.mark.slow
def test_finished_fits_are_recalled_and_the_result_is_the_same(
    axis_campaign: Path, journals: Path, counted: list[int]
) -> None:
    whole = diagnosed(axis_campaign)
    with pytest.raises(KeyboardInterrupt):
        diagnosed(axis_campaign, stop_at="cubic_stiffness")
    (journal,) = journals.iterdir()
    n_finished = len({json.loads(line)["key"] for line in journal.read_text().splitlines()})
    again = diagnosed(axis_campaign)
    assert counted[0] == counted[1] == 0
    assert counted[2] == n_finished > 3
    assert not journal.exists()
    assert again.to_json() == whole.to_json()


@pytest.mark.slow
def test_it_is_said_once_that_a_diagnosis_goes_on(axis_campaign: Path, journals: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        diagnosed(axis_campaign, stop_at="cubic_stiffness")
    (journal,) = journals.iterdir()
    count = len({json.loads(line)["key"] for line in journal.read_text().splitlines()})
    again: list[Step] = []
    diagnosed(axis_campaign, said=again)
    reported = [step for step in again if step.stage.startswith("Continuing")]
    assert [(step.done, step.total) for step in reported] == [(0, count), (count, count)]
    assert reported[0].stage == f"Continuing: {count} fits done before the interruption"
    fresh: list[Step] = []
    diagnosed(axis_campaign, said=fresh)
    assert not [step for step in fresh if step.stage.startswith("Continuing")]


@pytest.mark.slow
def test_fits_of_a_campaign_that_was_changed_since_are_not_told_of(
    axis_campaign: Path, journals: Path
) -> None:
    with pytest.raises(KeyboardInterrupt):
        diagnosed(axis_campaign, stop_at="cubic_stiffness")
    for record in axis_campaign.glob("*.csv"):
        head, *rows = record.read_text().splitlines()
        record.write_text("\n".join([head, *rows[: len(rows) - 50]]) + "\n")
    said: list[Step] = []
    diagnosed(axis_campaign, said=said)
    assert not [step for step in said if step.stage.startswith("Continuing")]


@pytest.mark.slow
def test_a_torn_or_foreign_line_is_not_read(axis_campaign: Path, journals: Path, counted: list[int]) -> None:
    with pytest.raises(KeyboardInterrupt):
        diagnosed(axis_campaign, stop_at="cubic_stiffness")
    (journal,) = journals.iterdir()
    first, *_ = journal.read_text().splitlines()
    journal.write_text(first + "\n" + '{"key": "x", "theta": "no numbers"}\n' + first[: len(first) // 2])
    assert diagnosed(axis_campaign).verdict
    assert counted[-1] == 1


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_stops_nothing(
    axis_campaign: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    in_the_way = tmp_path / "file"
    in_the_way.write_text("")
    monkeypatch.setattr("rigsight.workflow.diagnose.cache_folder", lambda: in_the_way)
    assert diagnosed(axis_campaign).verdict


@pytest.mark.slow
def test_fits_are_kept_where_the_disk_does_not_take_the_result(
    axis_campaign: Path, journals: Path, counted: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise MachineError("the disk is full")

    monkeypatch.setattr("rigsight.workflow.diagnose.write_together", full)
    with pytest.raises(MachineError):
        run_diagnose(axis_campaign, tmp_path / "out", effects=CANDIDATES, n_jobs=1)
    (journal,) = journals.iterdir()
    n_finished = len({json.loads(line)["key"] for line in journal.read_text().splitlines()})
    run_diagnose(axis_campaign, None, effects=CANDIDATES, n_jobs=1)
    assert counted == [0, n_finished]
