"""A log is told that work goes on, and is not filled with it."""

from __future__ import annotations

import pytest

from rigsight.workflow.run.progress import Step, log_lines, report_notes


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
