"""What surrounds all commands: help at once, the version, usage errors."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

RIGSIGHT = Path(sys.executable).with_name("rigsight")
Run = Callable[..., tuple[int, str, str]]


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["diagnos", "x"], "Did you mean 'diagnose'"),
        (["diagnose"], "CAMPAIGN"),
        (["diagnose", ".", "--jobs", "0"], "--jobs"),
        (["diagnose", ".", "--seed", "one"], "--seed"),
        (["diagnose", ".", "--effect", "cubic"], "Did you mean 'cubic_stiffness'"),
    ],
)
def test_usage_errors_exit_2(arguments: list[str], expected: str, run: Run) -> None:
    code, stdout, stderr = run(*arguments)
    assert code == 2
    assert stdout == ""
    assert expected in stderr
    assert "Traceback" not in stderr


def test_help_lists_the_commands() -> None:
    shown = subprocess.run([RIGSIGHT, "--help"], capture_output=True, text=True, check=True)
    for command in ("demo", "diagnose", "simulate"):
        assert command in shown.stdout


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, rigsight.cli; sys.exit(bool({'numpy', 'sympy', 'pydantic'} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_version(run: Run) -> None:
    code, stdout, _ = run("--version")
    assert code == 0
    assert stdout.startswith("rigsight 0.")
