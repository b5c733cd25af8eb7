"""What ``rigsight diagnose`` leaves and tells."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

Run = Callable[..., tuple[int, str, str]]


def test_diagnose_leaves_three_results_and_tells_the_verdict(
    axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    out = tmp_path / "out"
    code, stdout, stderr = run("diagnose", axis_campaign, "-o", out, "--effect", "cubic_stiffness", "-j", "1")
    assert code == 0, stderr
    assert sorted(path.name for path in out.iterdir()) == [
        "check.html",
        "check.json",
        "diagnosis.json",
        "model.json",
        "report.html",
    ]
    assert "cubic stiffness" in stdout
    assert str(out / "report.html") in stdout.replace("\n", "")
    assert json.loads((out / "diagnosis.json").read_text())["effects"] == ["cubic_stiffness"]


@pytest.mark.slow
def test_quiet_says_nothing(axis_campaign: Path, tmp_path: Path, run: Run) -> None:
    arguments = ("-o", tmp_path / "out", "--effect", "cubic_stiffness", "--quiet", "--jobs", "1")
    assert run("diagnose", axis_campaign, *arguments) == (0, "", "")


def test_a_file_in_the_way_of_the_results_is_told_before_the_work(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(*_: object, **__: object) -> None:
        pytest.fail("the work had begun")

    monkeypatch.setattr("rigsight.workflow.diagnose.prepare_kernels", work)
    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose", work)
    (tmp_path / "out").write_text("mine")
    for out in (tmp_path / "out", tmp_path / "out" / "below"):
        code, _, stderr = run("diagnose", axis_campaign, "-o", out)
        assert code == 2
        assert "is a file" in stderr
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a folder in which nobody can write")
def test_a_folder_that_cannot_be_written_is_told(axis_campaign: Path, run: Run) -> None:
    code, _, stderr = run("diagnose", axis_campaign, "-o", "/proc/rigsight/out")
    assert code == 2
    assert "Cannot write results" in stderr
