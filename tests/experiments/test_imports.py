"""What studies and benchmarks import of rigsight is there: no test runs most of them."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OURS = ("rigsight", "rigsight_bench")
FILES = sorted(path for folder in ("experiments", "benchmarks") for path in (ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_study_imports_is_there(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS:
            module = importlib.import_module(str(node.module))
            for name in (alias.name for alias in node.names):
                assert hasattr(module, name) or importlib.import_module(f"{node.module}.{name}")


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_module_that_a_study_names_in_a_text_is_there(path: Path) -> None:
    """Such a name is imported, instrumented or replaced at run time: a fuzzer whose list is outdated sees no coverage."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    parts = {id(node.values[0]) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) and node.values}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Constant) or not isinstance(node.value, str):
            continue
        if not re.fullmatch(r"rigsight(_bench)?(\.\w+)*\.?\w*", node.value):
            continue
        if id(node) in parts:
            # The beginning of a name: the package is there, and something in it is called like this.
            package, _, begun = node.value.rpartition(".")
            modules = pkgutil.iter_modules(importlib.import_module(package).__path__)
            assert any(module.name.startswith(begun) for module in modules), node.value
        elif "." in node.value:
            assert _is_there(node.value), node.value


def _is_there(name: str) -> bool:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        package, _, last = name.rpartition(".")
        return bool(package) and hasattr(importlib.import_module(package), last)
    return True
