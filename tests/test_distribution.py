"""Do the wheels hold all of their packages, and does rigsight run outside of the repository?"""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build wheels and source distributions as `make dist` does, and return their folder."""
    folder = tmp_path_factory.mktemp("dist")
    for project in (ROOT, ROOT / "bench"):
        subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-d", str(folder)],
            cwd=project,
            check=True,
            capture_output=True,
        )
    return folder


@pytest.mark.release
@pytest.mark.parametrize("source", [ROOT / "src", ROOT / "bench/src"], ids=["rigsight", "bench"])
def test_the_wheel_holds_every_file_of_the_package_and_nothing_else(built: Path, source: Path) -> None:
    (package,) = (folder.name for folder in source.iterdir())
    (wheel,) = built.glob(f"{package}-*.whl")
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    wanted = {
        path.relative_to(source).as_posix()
        for path in source.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert held == wanted
    assert wheel.stat().st_size < 2e6


@pytest.mark.release
def test_the_source_distribution_holds_what_it_is_built_and_tested_from(built: Path) -> None:
    (archive,) = built.glob("rigsight-*.tar.gz")
    with tarfile.open(archive) as opened:
        top = {name.split("/", 2)[1] for name in opened.getnames()}
    assert top == {
        "bench", "src", "tests", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "README.md", "requirements.lock",
        "pyproject.toml", "PKG-INFO", ".gitignore",
    }  # fmt: skip


@pytest.mark.release
def test_the_wheel_runs_outside_of_the_repository(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("rigsight-*.whl")
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    code = (
        "import sys; sys.path.insert(0, sys.argv.pop(1)); import rigsight; from rigsight.cli import main; "
        "assert rigsight.__file__.startswith(sys.path[0]), rigsight.__file__; main()"
    )
    ran = subprocess.run(
        [sys.executable, "-I", "-c", code, str(tmp_path / "site"), "rigs", "--json"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert "running_gear" in json.dumps(json.loads(ran.stdout))


def test_the_version_is_the_same_wherever_it_stands() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    bench = tomllib.loads((ROOT / "bench/pyproject.toml").read_text(encoding="utf-8"))["project"]
    version = project["version"]
    assert bench["version"] == version
    assert bench["dependencies"] == [f"rigsight=={version}"]
    assert project["optional-dependencies"]["bench"] == [f"rigsight-bench=={version}"]
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"## [{version}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
