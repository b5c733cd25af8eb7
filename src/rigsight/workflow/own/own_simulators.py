"""Python functions of a user as simulators of rigs; only the command line can name them, never a campaign alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rigsight.errors import InputError, nearest
from rigsight.simulators import give_function
from rigsight.workflow.own.python_file import run_python_file

_WRITTEN = "--simulator expects a Python file and a function in it, for instance arm.py:accelerations."


def own_simulators(named: Iterable[str]) -> None:
    """Execute Python files and register functions of them as simulators."""
    taken: dict[str, str] = {}
    for one in named:
        file, colon, name = one.rpartition(":")
        if not colon or not file.endswith(".py") or not name:
            raise InputError(f"--simulator: got '{one}'. {_WRITTEN}")
        module, _ = run_python_file(Path(file), "the Python file with the simulator", _WRITTEN)
        functions = [
            key for key, value in vars(module).items() if callable(value) and not key.startswith("_")
        ]
        if name not in functions:
            raise InputError(
                f"{file} has no function '{name}'.{nearest(name, functions)} It has: {', '.join(functions) or 'none'}."
            )
        if name in taken:
            raise InputError(
                f"--simulator: {taken[name]} and {one} have the same function name; rename one of them."
            )
        taken[name] = one
        give_function(name, getattr(module, name))
