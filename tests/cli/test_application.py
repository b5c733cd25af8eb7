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


@pytest.mark.slow
def test_help_lists_the_commands() -> None:
    shown = subprocess.run([RIGSIGHT, "--help"], capture_output=True, text=True, check=True)
    for command in ("demo", "diagnose", "simulate"):
        assert command in shown.stdout


@pytest.mark.slow
def test_the_package_runs_as_a_module() -> None:
    shown = subprocess.run(
        [sys.executable, "-m", "rigsight", "--version"], capture_output=True, text=True, check=True
    )
    assert shown.stdout.startswith("rigsight ")


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, rigsight.cli; sys.exit(bool({'numpy', 'sympy', 'pydantic', 'sqlite3'} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.slow
def test_nothing_but_the_bench_needs_dask_and_sqlite() -> None:
    """Help, every public name and every other command come without them."""
    code = """
import contextlib, importlib, pkgutil, sys
import rigsight, rigsight.cli, rigsight.workflow
sys.argv = ["rigsight", "--help"]
with contextlib.suppress(SystemExit):
    rigsight.cli.main()
for name in rigsight.__all__:
    getattr(rigsight, name)
for package in (rigsight.cli, rigsight.workflow):
    for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        importlib.import_module(module.name)
found = [name for name in sys.modules if name.startswith(("sqlite3", "distributed", "dask", "rigsight_bench.running"))]
sys.exit(", ".join(found) or 0)
"""
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr


def test_version(run: Run) -> None:
    code, stdout, _ = run("--version")
    assert code == 0
    assert stdout.startswith("rigsight 0.")
