"""How is a JSON file read that somebody may have written by hand?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rigsight.errors import InputError
from rigsight.records.formats.ordinary_file import file_size

LARGEST_FILE = 10_000_000


def json_object(path: Path, what: str, mend: str) -> dict[str, Any]:
    """Return the object that a file holds.

    Parameters
    ----------
    path
        The file.
    what
        What it should be: ``"model"``.
    mend
        A sentence on where such a file comes from or what it holds.

    Raises
    ------
    InputError
        Naming the file, and line and column of what is no JSON; also for repeated keys and NaN, which Python would read.
    """
    try:
        if file_size(path) > LARGEST_FILE:
            raise InputError(f"{path.name} is larger than {LARGEST_FILE / 1e6:g} MB: it is no {what}.")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path.name} is not UTF-8 text (byte {error.start}); it is no {what}.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    try:
        data = json.loads(text, object_pairs_hook=_without_repeated_keys, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path.name}, line {error.lineno}, column {error.colno}: is not valid JSON: {error.msg}. {mend}"
        ) from None
    except RecursionError:
        raise InputError(f"{path.name}: is nested deeper than a {what} ever is. {mend}") from None
    except (_MeaninglessError, ValueError) as error:
        raise InputError(f"{path.name}: {error}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path.name}: must hold one object in braces, got a {type(data).__name__}. {mend}")
    return data


class _MeaninglessError(Exception):
    """JSON that Python would read but that means nothing."""


def _without_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise _MeaninglessError(f"the key '{key}' stands twice in one table; remove one.")
        content[key] = value
    return content


def _refuse_constant(name: str) -> float:
    raise _MeaninglessError(f"{name} is no number that a simulation can use; give finite numbers.")
