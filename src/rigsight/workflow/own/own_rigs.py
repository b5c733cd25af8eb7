"""Find rigs by name: the built-in ones, and those of a user's own rig files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from rigsight.errors import InputError, nearest
from rigsight.rigs import RIGS, KnownRigs, Rig, read_rig_file
from rigsight.simulators import give_function
from rigsight.workflow.own.python_file import run_python_file

_WRITTEN = "--simulator expects a Python file and a function in it, for instance arm.py:accelerations."


def own_rigs(files: Iterable[str | Path]) -> dict[Path, Rig]:
    """Return the rigs that files declare."""
    found: dict[Path, Rig] = {}
    taken = dict.fromkeys(RIGS, "a built-in rig")
    for path in {Path(file).resolve(): Path(file) for file in files}.values():
        rig = read_rig_file(path)
        if rig.name in taken:
            raise InputError(
                f"{path}: name: '{rig.name}' is the name of {taken[rig.name]}; give the rig another name."
            )
        taken[rig.name] = f"the rig of {path}"
        found[path] = rig
    return found


def known_rigs(own: Iterable[Rig] = ()) -> Mapping[str, Rig]:
    """Return all rigs by name; a built-in one is read when it is asked for."""
    return KnownRigs({rig.name: rig for rig in own})


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
