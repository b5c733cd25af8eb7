"""What does `import rigsight` offer, and what does it load?"""

from __future__ import annotations

import ast
import inspect
import pkgutil
import subprocess
import sys
from pathlib import Path

import pytest

import rigsight as rs

HEAVY = {"matplotlib", "numpy", "pandas", "pydantic", "rich", "scipy", "sklearn", "sympy", "typer"}


def declared_for_type_checkers() -> dict[str, str]:
    """Return name -> module of the imports that only type checkers read."""
    tree = ast.parse(Path(inspect.getfile(rs)).read_text(encoding="utf-8"))
    (block,) = (
        node
        for node in tree.body
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    )
    return {
        alias.asname or "": f"{statement.module}"
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for alias in statement.names
    }


def test_importing_loads_nothing_heavy() -> None:
    code = f"import sys, rigsight; sys.exit(bool({HEAVY!r} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_an_error_is_caught_without_loading_anything_heavy() -> None:
    code = f"import sys, rigsight as rs; rs.InputError; sys.exit(bool({HEAVY!r} & sys.modules.keys()))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_check_loads_no_other_command() -> None:
    others = {"joblib", "matplotlib", "pint", "rich"}
    others |= {f"rigsight.{room}" for room in ("compare", "discover", "plan", "plot", "robots")}
    code = f"import sys, rigsight.workflow.check; sys.exit(', '.join({others!r} & sys.modules.keys()) or 0)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


@pytest.mark.parametrize("name", rs.__all__)
def test_every_name_is_there(name: str) -> None:
    assert getattr(rs, name) is not None
    assert name in dir(rs)


def test_type_checkers_see_the_same_names_in_the_same_places() -> None:
    assert declared_for_type_checkers() == rs._HOMES
    assert sorted(rs._HOMES) == rs.__all__


def test_no_name_is_that_of_a_room() -> None:
    # Importing a package sets its name on the package, over whatever stood there.
    packages = {module.name for module in pkgutil.iter_modules(rs.__path__)}
    assert "simulate" in packages
    assert not packages.intersection(rs.__all__)


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"'rigsight' has no attribute 'diagnoser'"):
        _ = rs.diagnoser  # type: ignore[attr-defined]
