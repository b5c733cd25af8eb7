"""How does a function of a user's own become the simulator of a rig? Named on the command line, never by a campaign alone."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rigsight.errors import InputError, nearest
from rigsight.simulators import give_function
from rigsight.workflow.own.python_file import run_python_file

_WRITTEN = "--simulator names a Python file and a function in it, as arm.py:accelerations."


def own_simulators(named: Iterable[str]) -> None:
    """Run Python files, and let rigs be simulated by functions of theirs.

    Parameters
    ----------
    named
        ``FILE.py:FUNCTION`` each; a rig file calls it ``file = "FUNCTION"``.

    Raises
    ------
    InputError
        If a file cannot be run or has no such function.
    """
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
            raise InputError(f"--simulator: {taken[name]} and {one} are called the same; rename one of them.")
        taken[name] = one
        give_function(name, getattr(module, name))
