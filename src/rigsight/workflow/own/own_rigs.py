"""Find rigs by name, built-in ones and those of a user's own files, and run a user's own Python files."""

from __future__ import annotations

import ast
import traceback
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType

from rigsight.errors import InputError, RigsightError, nearest
from rigsight.records.formats.known import file_size
from rigsight.rigs import RIGS, KnownRigs, Rig, read_rig_file
from rigsight.simulators import give_function

_WRITTEN = "--simulator expects a Python file and a function in it, for instance arm.py:accelerations."
_LARGEST_FILE = 1_000_000


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


def run_python_file(path: Path, what: str, if_missing: str) -> tuple[ModuleType, ast.Module]:
    """Execute a file, and return its module and its syntax tree."""
    if not path.exists():
        raise InputError(f"{path} does not exist; {if_missing}")
    source = text_of(path, what, _LARGEST_FILE)
    if path.suffix != ".py":
        raise InputError(f"{path} is not {what}: its name would end in .py.")
    try:
        tree = ast.parse(source, filename=str(path))
        code = compile(tree, str(path), "exec", dont_inherit=True)
    except SyntaxError as error:
        raise InputError(f"{path.name}, line {error.lineno}: is not valid Python: {error.msg}.") from None
    except ValueError as error:
        raise InputError(f"{path.name}: is not valid Python: {error}.") from None
    except (RecursionError, MemoryError):
        raise InputError(f"{path.name}: is nested too deeply for Python.") from None
    module = ModuleType(f"rigsight_own_{path.stem}")
    module.__file__ = str(path)
    try:
        exec(code, module.__dict__)
    except (Exception, SystemExit) as error:
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)]
        where = f"{path.name}, line {lines[-1]}" if lines else path.name
        kind = "" if isinstance(error, RigsightError) else f"{type(error).__name__}: "
        raise InputError(f"{where}: running the file failed: {kind}{error}") from None
    return module, tree


def text_of(path: Path, what: str, largest: int, if_not_text: str = "", called: str | None = None) -> str:
    """Return the text of a file, which is not `what` if it is larger than so many bytes."""
    if file_size(path, called or what) > largest:
        raise InputError(f"{path.name} is larger than {largest / 1e6:g} MB, so it is not {what}.")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text (byte {error.start}){if_not_text}.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
