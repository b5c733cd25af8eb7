"""The rules of CONTRIBUTING.md that a machine can check."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from rigsight.cli.application import COMMANDS
from rigsight.rigs import RIGS

ROOT = Path(__file__).parents[1]
PACKAGES = (ROOT / "src/rigsight", ROOT / "bench/src/rigsight_bench")
MODULES = sorted(module for package in PACKAGES for module in package.rglob("*.py"))
LONGEST_FILE = 600
NAME_A_RIG = {
    "workflow/campaign/in_memory.py": "the records of the ten lines of the README come from a virtual axis",
    "identify/hysteresis/derived.py": "a loop of hysteresis alone is the built-in element with one spring",
    "identify/transfer/conicity.py": "API: equation (2.12) of the thesis, of the running gear",
    "rigs/built_in.py": "the built-in rigs",
    "workflow/demo.py": "the demo is the running gear of the thesis",
    "workflow/own/effect_benches.py": "effects of one's own are tried on three built-in rigs",
    "trials/standard/campaign.py": "the standard design draws axes and running gears",
    "trials/standard/trial.py": "rolling effects are drawn on the running gear, the only built-in rig that rolls",
    "trials/handwritten/cells.py": "which rig each hidden effect of the handwritten design has",
    "trials/handwritten/plants.py": "whose equations are written by hand are built-in rigs",
    "trials/laboratory/stands.py": "the stands of the laboratory design are built-in rigs",
    "trials/laboratory/subjects.py": "which stand each hidden effect of the laboratory design has",
}
"""Modules by their path in their package."""
NAMES_WITHOUT_A_QUESTION = {"utils", "util", "common", "core", "helpers", "misc"}


def in_package(module: Path) -> Path:
    return module.relative_to(next(package for package in PACKAGES if module.is_relative_to(package)))


def test_rooms_import_only_downwards() -> None:
    lint = Path(sys.executable).with_name("lint-imports")
    run = subprocess.run(
        [lint, "--no-cache"], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("module", MODULES, ids=lambda path: str(in_package(path)))
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


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="this is no checkout of git")
def test_git_has_every_file() -> None:
    """A commit without one of its files could not be imported, whatever .gitignore says."""
    listed = subprocess.run(
        ["git", "ls-files", "--others", "-x", "__pycache__", "-x", "*.egg-info", "src", "bench", "tests"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if listed.returncode:
        pytest.skip("git cannot be run here")
    assert not listed.stdout, f"Add these files with git add, or remove them:\n{listed.stdout}"


def test_every_language_is_printed_in_one_place() -> None:
    """Two printers of one language would in time print two equations."""
    printers = {
        in_package(module).as_posix()
        for module in MODULES
        if any(word in module.read_text(encoding="utf-8") for word in ("sympy.printing", "sp.latex("))
    }
    assert {name for name in printers if not name.startswith("simulate/printing/")} == set()


def test_no_text_names_a_module_of_a_package_above() -> None:
    """The linter does not see an import that stands in a text: code for another process, a name for importlib."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    layers = next(c["layers"] for c in contracts if c.get("containers") == ["rigsight"])
    height = {package: -i for i, layer in enumerate(layers) for package in layer.split(" | ")}
    found = []
    for module in (ROOT / "src" / "rigsight").rglob("*.py"):
        own = module.relative_to(ROOT / "src" / "rigsight").with_suffix("").parts[0]
        source = module.read_text(encoding="utf-8")
        if not re.search(r"^(?!from |import ).*rigsight\.", source, re.MULTILINE):
            continue
        tree = ast.parse(source)
        reported = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in reported:
                named = re.findall(r"(?:^|import |from )rigsight\.([a-z_]+)", node.value)
                found += [
                    f"{module}: {node.value}"
                    for package in named
                    if height.get(package, -99) > height.get(own, 0)
                ]
    assert found == []


def test_beside_its_rooms_workflow_holds_commands_only() -> None:
    workflow = ROOT / "src" / "rigsight" / "workflow"
    assert {module.stem for module in workflow.glob("*.py")} - {"__init__"} <= COMMANDS.keys()


def test_no_other_module_knows_a_rig_by_name() -> None:
    """A user's rig is treated as the built-in ones are."""
    constants = {name.upper() for name in RIGS}

    def names_one(node: ast.AST) -> bool:
        if isinstance(node, ast.ImportFrom):
            return any(alias.name in constants for alias in node.names)
        if isinstance(node, ast.Attribute):
            return node.attr in constants
        return isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in RIGS

    found = {
        in_package(module).as_posix()
        for module in MODULES
        if any(map(names_one, ast.walk(ast.parse(module.read_text(encoding="utf-8")))))
    }
    assert found == NAME_A_RIG.keys()
