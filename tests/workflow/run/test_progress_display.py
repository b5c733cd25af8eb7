"""A log is told that work goes on, and is not filled with it."""

from __future__ import annotations

import json

import pytest

from rigsight.workflow.run.progress import Stage, Step, listening, log_lines, report_notes


def test_a_remark_is_no_work(capsys: pytest.CaptureFixture[str]) -> None:
    report_notes(["The sample times differ."], log_lines(between=30.0, clock=lambda: 0.0))
    assert capsys.readouterr().err == "Note: The sample times differ.\n"


def test_a_log_gets_a_line_per_stage_and_one_now_and_then(capsys: pytest.CaptureFixture[str]) -> None:
    times = iter((0.0, 0.0, 10.0, 31.0, 31.0, 45.0))
    say = log_lines(between=30.0, clock=lambda: next(times))
    say(Step("Diagnosing", "", 0, 3))
    for detail in ("noise floor", "suspects", "backlash"):
        say(Step("Diagnosing", detail, 1, 40))
    assert capsys.readouterr().err.splitlines() == ["Diagnosing ...", "Diagnosing (1 of 40): suspects"]


def test_other_programs_get_every_step_as_a_line_of_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RIGSIGHT_PROGRESS", "json")
    with listening(quiet=False) as listener:
        stage = Stage("Fitting", 2, listener)
        stage.finished("first")
    with listening(quiet=True) as listener:
        Stage("Unheard", 2, listener)
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert [(one["stage"], one["detail"], one["done"], one["total"]) for one in lines] == [
        ("Fitting", "", 0, 2),
        ("Fitting", "first", 1, 2),
    ]
    assert 0.0 <= lines[0]["seconds"] <= lines[1]["seconds"]
