"""Read a JSON file that may have been written by hand."""

from __future__ import annotations

import json
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from rigsight.errors import InputError
from rigsight.records.formats.known import file_size

_VERSIONS_OF = ("rigsight", "numpy", "scipy")


LARGEST_FILE = 10_000_000


def json_object(path: Path, what: str, remedy: str) -> dict[str, Any]:
    """Return the object that a file holds."""
    try:
        if file_size(path) > LARGEST_FILE:
            raise InputError(f"{path.name} is larger than {LARGEST_FILE / 1e6:g} MB, so it is not a {what}.")
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path.name} is not UTF-8 text (byte {error.start}), so it is not a {what}."
        ) from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    try:
        data = json.loads(text, object_pairs_hook=_without_repeated_keys, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise InputError(
            f"{path.name}, line {error.lineno}, column {error.colno}: is not valid JSON: {error.msg}. {remedy}"
        ) from None
    except RecursionError:
        raise InputError(f"{path.name}: is nested too deeply for a {what}. {remedy}") from None
    except (_MeaninglessError, ValueError) as error:
        raise InputError(f"{path.name}: {error}") from None
    if not isinstance(data, dict):
        raise InputError(
            f"{path.name}: must contain one object in braces, got a {type(data).__name__}. {remedy}"
        )
    return data


class _MeaninglessError(Exception):
    """JSON that Python accepts but that is meaningless here."""


def _without_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for key, value in pairs:
        if key in content:
            raise _MeaninglessError(f"the key '{key}' occurs twice in one object; remove one.")
        content[key] = value
    return content


def _refuse_constant(name: str) -> float:
    raise _MeaninglessError(f"{name} is not a finite number; give finite numbers.")


def versions() -> dict[str, str]:
    """Return the versions of these packages, by name."""
    found = {"python": platform.python_version()}
    for package in _VERSIONS_OF:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
