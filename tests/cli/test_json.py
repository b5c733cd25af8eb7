"""What a command prints with --json is the result that it wrote, and nothing else."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rigsight.effects import CATALOGUE

RIGSIGHT = Path(sys.executable).with_name("rigsight")
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def diagnosed(axis_campaign: Path, tmp_path: Path, run: Run) -> tuple[Path, str]:
    out = tmp_path / "out"
    arguments = ("-o", out, "--effect", "cubic_stiffness", "--jobs", "1", "--json")
    code, stdout, stderr = run("diagnose", axis_campaign, *arguments)
    assert code == 0, stderr
    return out, stdout


def test_diagnosis_is_the_file_that_was_written(diagnosed: tuple[Path, str]) -> None:
    out, stdout = diagnosed
    assert json.loads(stdout) == json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert json.loads(stdout)["effects"] == ["cubic_stiffness"]


def test_simulation_tells_where_it_wrote(
    diagnosed: tuple[Path, str], axis_campaign: Path, tmp_path: Path, run: Run
) -> None:
    record = sorted(axis_campaign.glob("*.csv"))[0]
    file = tmp_path / "simulated.csv"
    code, stdout, _ = run("simulate", diagnosed[0], record, "-o", file, "--json")
    assert code == 0
    assert json.loads(stdout) == {
        "schema_version": 1,
        "file": str(file),
        "n_samples": len(file.read_text(encoding="utf-8").splitlines()) - 1,
        "notes": [],
    }


def test_effects_are_listed_with_equations(run: Run) -> None:
    code, stdout, _ = run("effects", "--json")
    assert code == 0
    listed = json.loads(stdout)["effects"]
    assert [effect["name"] for effect in listed] == [effect.name for effect in CATALOGUE]
    assert all(effect["equations"] or effect["states"] for effect in listed)


def test_errors_leave_stdout_empty(tmp_path: Path, run: Run) -> None:
    code, stdout, stderr = run("diagnose", tmp_path / "nowhere", "--json")
    assert (code, stdout) == (2, "")
    assert "nowhere" in stderr


def test_every_command_takes_it(run: Run) -> None:
    _, overview, _ = run("--help")
    commands = [
        line.split()[0] for line in overview.split("Commands:")[1].splitlines() if line.startswith("  ")
    ]
    for command in commands[:-1]:
        assert "--json" in run(command, "--help")[1], command


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="completion of another shell there")
def test_the_shell_completes_names_of_effects() -> None:
    environment = {
        **os.environ,
        "_RIGSIGHT_COMPLETE": "complete_bash",
        "COMP_WORDS": "rigsight diagnose --effect cub",
        "COMP_CWORD": "3",
    }
    shown = subprocess.run([RIGSIGHT], env=environment, capture_output=True, text=True, check=False)
    assert shown.stdout.split() == ["cubic_stiffness"]
