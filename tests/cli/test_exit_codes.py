"""A defect and an interruption end in one message and an exit code, and leave nothing behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

RIGSIGHT = Path(sys.executable).with_name("rigsight")
Run = Callable[..., tuple[int, str, str]]


def test_a_defect_exits_1_with_one_line(
    axis_campaign: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def defective(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr("rigsight.workflow.diagnose.diagnose", defective)
    arguments = (
        "diagnose",
        axis_campaign,
        "-o",
        tmp_path / "out",
        "--effect",
        "cubic_stiffness",
        "--jobs",
        "1",
    )
    code, _, stderr = run(*arguments, "--quiet")
    assert code == 1
    assert stderr.count("\n") == 1
    assert "ZeroDivisionError: a b" in stderr
    assert "--debug" in stderr
    assert not (tmp_path / "out").exists()
    with pytest.raises(ZeroDivisionError):
        run(*arguments, "--debug")


@pytest.mark.skipif(sys.platform == "win32", reason="signals differ there")
@pytest.mark.parametrize("stage", ["Compiling", "Diagnosing"])
def test_an_interrupted_diagnosis_leaves_nothing(stage: str, axis_campaign: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    environment = dict(os.environ)
    if stage == "Compiling":
        environment["RIGSIGHT_CACHE_DIR"] = str(tmp_path / "kernels")
    process = subprocess.Popen(
        [RIGSIGHT, "diagnose", axis_campaign, "-o", out, "--jobs", "2"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stderr is not None
    seen = ""
    for line in process.stderr:
        seen += line
        if line.startswith(stage):
            break
    time.sleep(2.0)
    # As a terminal does it: to the whole group, worker processes included.
    os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=180)
    assert process.returncode == 130, seen + stderr
    assert stdout == ""
    assert "Traceback" not in stderr
    assert stderr.strip().endswith("interrupted; nothing was written; the same command goes on from there.")
    assert not out.parent.exists()
