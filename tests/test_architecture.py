"""The rules of the house that a machine can check."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted((ROOT / "src").rglob("*.py"))
LONGEST_FILE = 600
NAMES_WITHOUT_A_QUESTION = {"utils", "util", "common", "core", "helpers", "misc"}


def test_rooms_import_only_downwards() -> None:
    lint = Path(sys.executable).with_name("lint-imports")
    run = subprocess.run(
        [lint, "--no-cache"], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_a_module_is_short_and_says_its_question(module: Path) -> None:
    text = module.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST_FILE
    assert text == "" or text.startswith('"""')
    assert not NAMES_WITHOUT_A_QUESTION.intersection(module.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("lock", ["requirements.lock", "docs/requirements.lock"])
def test_the_lock_pins_every_package_and_names_no_place(lock: str) -> None:
    lines = (ROOT / lock).read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    for line in pins:
        assert "==" in line
        assert "://" not in line
        assert "file:" not in line


def test_every_language_is_printed_in_one_place() -> None:
    """Two printers of one language would in time print two equations."""
    printers = {
        str(module.relative_to(ROOT / "src" / "rigsight").as_posix())
        for module in MODULES
        if any(word in module.read_text(encoding="utf-8") for word in ("sympy.printing", "sp.latex("))
    }
    assert {name for name in printers if not name.startswith("simulate/printing/")} == set()
