"""Execute a user's Python file; errors become one message with the line."""

from __future__ import annotations

import ast
import traceback
from pathlib import Path
from types import ModuleType

from rigsight.errors import InputError, RigsightError
from rigsight.records.formats.known import file_size

_LARGEST_FILE = 1_000_000


def run_python_file(path: Path, what: str, if_missing: str) -> tuple[ModuleType, ast.Module]:
    """Execute a file, and return its module and its syntax tree."""
    source = _source(path, what, if_missing)
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


def _source(path: Path, what: str, if_missing: str) -> str:
    if path.exists() and file_size(path, what) > _LARGEST_FILE:
        raise InputError(f"{path.name} is larger than {_LARGEST_FILE / 1e6:g} MB, so it is not {what}.")
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text (byte {error.start}).") from None
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; {if_missing}") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
