"""Without the package of the bench, its command says how to get it, and every other command works."""

from __future__ import annotations

import subprocess
import sys

import pytest

WITHOUT = "import sys; sys.modules['rigsight_bench'] = None; from rigsight.cli import main; main()"


def rigsight(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, *arguments], capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        pytest.param(("--design", "laboratory", "--trials", "3"), marks=pytest.mark.slow),
        pytest.param(("--merge", "a", "b"), marks=pytest.mark.slow),
    ],
)
def test_a_bench_that_is_not_installed_says_how_it_is(arguments: tuple[str, ...]) -> None:
    ran = rigsight("blind", *arguments)
    assert (ran.returncode, ran.stdout) == (2, "")
    assert "pip install ./bench" in ran.stderr
    assert len(ran.stderr.splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [("--help",), ("blind", "--help")])
def test_help_lists_the_command_all_the_same(arguments: tuple[str, ...]) -> None:
    ran = rigsight(*arguments)
    assert ran.returncode == 0
    assert "blind" in ran.stdout


@pytest.mark.slow
def test_other_commands_do_without_the_bench() -> None:
    ran = rigsight("rigs", "--json")
    assert ran.returncode == 0, ran.stderr
    assert "running_gear" in ran.stdout
