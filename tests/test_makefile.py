"""What `make` installs for which target, and that it takes an interrupted installation up again."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[1]
MAKE = shutil.which("make")
# It writes down what it is asked for and does nothing; an installation of what `broken` names ends half done.
PYTHON = """\
#!/bin/sh
case "$*" in
    "-m venv "*) mkdir -p .venv/bin && cp "$0" .venv/bin/python && cp "$0" .venv/bin/rigsight ;;
    "-m pip install "* | "-m uv pip install "*)
        echo "$*" >> calls
        if [ -e broken ] && echo "$*" | grep -q -- "$(cat broken)"; then exit 1; fi ;;
    "-m pytest "*) echo "tests ran" >> calls ;;
    "demo "*) echo "demo ran" >> calls ;;
esac
"""
RUNNABLE, DEVELOPMENT = "--editable .", "--requirement requirements.lock"

Make = Callable[..., list[str]]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder with the Makefile and what it reads, and a Python that only takes notes."""
    (tmp_path / "bench").mkdir()
    for name in ("Makefile", "pyproject.toml", "bench/pyproject.toml", "requirements.lock"):
        shutil.copy(ROOT / name, tmp_path / name)
    python = tmp_path / "python"
    python.write_text(PYTHON, "utf-8")
    python.chmod(0o755)
    return tmp_path


@pytest.fixture
def make(project: Path) -> Make:
    """Run make; return what was asked of Python."""
    if MAKE is None:
        pytest.skip("make is not installed")
    # A make around the tests must not tell this one what to do.
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))
    }

    def call(target: str, succeeds: bool = True) -> list[str]:
        calls = project / "calls"
        calls.write_text("", "utf-8")
        ran = subprocess.run(
            [MAKE, target, f"PYTHON={project / 'python'}"],
            cwd=project, env={**environment, "CC": "cc"}, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert (ran.returncode == 0) is succeeds, ran.stdout + ran.stderr
        return calls.read_text("utf-8").splitlines()

    return call


def installed(calls: list[str], what: str) -> bool:
    return any(what in call for call in calls)


@pytest.mark.release
def test_the_demo_installs_what_it_runs_with_pinned_and_nothing_else(make: Make) -> None:
    calls = make("demo")
    assert installed(calls, RUNNABLE)
    assert not installed(calls, DEVELOPMENT)
    others = [call for call in calls if "pip install" in call and not call.endswith("uv==0.13.8")]
    assert others
    assert all("--constraint requirements.lock" in call for call in others)
    assert calls[-1] == "demo ran"
    assert make("demo") == ["demo ran"]


@pytest.mark.release
def test_the_tests_install_the_rest_on_top(make: Make) -> None:
    make("demo")
    calls = make("test")
    assert not installed(calls, RUNNABLE)
    assert installed(calls, DEVELOPMENT)
    assert calls[-1] == "tests ran"
    assert make("test") == ["tests ran"]
    assert make("demo") == ["demo ran"]


@pytest.mark.release
@pytest.mark.parametrize("step", ["hatchling", RUNNABLE, DEVELOPMENT])
def test_an_interrupted_installation_is_taken_up_again(step: str, make: Make, project: Path) -> None:
    broken = project / "broken"
    broken.write_text(step, "utf-8")
    calls = make("test", succeeds=False)
    assert installed(calls, step)
    assert "tests ran" not in calls
    broken.unlink()
    calls = make("test")
    assert installed(calls, step)
    assert installed(calls, DEVELOPMENT)
    assert calls[-1] == "tests ran"


@pytest.mark.release
def test_where_uv_cannot_be_had_or_fails_pip_installs(make: Make, project: Path) -> None:
    (project / "broken").write_text("uv", "utf-8")
    calls = make("test")
    for what in (RUNNABLE, DEVELOPMENT):
        (by_uv, by_pip) = [call for call in calls if what in call]
        assert by_uv.startswith("-m uv ")
        assert by_pip.startswith("-m pip ")
    assert calls[-1] == "tests ran"


@pytest.mark.release
@pytest.mark.parametrize("changed", ["requirements.lock", "pyproject.toml"])
def test_another_lock_or_other_dependencies_are_installed_by_the_next_call(
    changed: str, make: Make, project: Path
) -> None:
    make("test")
    newer = (project / ".venv/.development-installed").stat().st_mtime + 10.0
    os.utime(project / changed, (newer, newer))
    calls = make("test")
    assert installed(calls, RUNNABLE)
    assert installed(calls, DEVELOPMENT)


def test_the_lock_pins_all_that_the_demo_installs() -> None:
    """What a constraint does not name comes in any version, and not in the one that was tested."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    lines = (ROOT / "requirements.lock").read_text("utf-8").splitlines()
    pinned = {canonicalize_name(line.partition("==")[0]) for line in lines if "==" in line}
    waiting = [*map(Requirement, project["project"]["dependencies"]), Requirement("hatchling")]
    assert len(waiting) > 10
    seen: set[str] = set()
    while waiting:
        name = canonicalize_name(waiting.pop().name)
        if name not in seen:
            seen.add(name)
            needed = map(Requirement, importlib.metadata.requires(name) or [])
            # Without extras, on this machine.
            waiting += [one for one in needed if one.marker is None or one.marker.evaluate({"extra": ""})]
    assert seen <= pinned, sorted(seen - pinned)
