"""A text in TOML -> its tables, and line and column of the value of each key, which tomllib does not report."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any

from rigsight.errors import InputError

Path = tuple[str | int, ...]
Place = tuple[int, int]

_HEADER = re.compile(r"\s*(\[\[?)([^\[\]]+)\]\]?\s*(?:#.*)?")
_KEY = re.compile(
    r"""\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))*)\s*=\s*"""
)
_INNER = re.compile(r"""[{,]\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*'))\s*=\s*""")
_QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"|' r"'[^']*'")


def value_places(text: str) -> dict[Path, Place]:
    """Return the line and column, from 1, of every value by its path of keys, and of every table's header by its own."""
    # Values within arrays have no place of their own.
    places: dict[Path, Place] = {}
    table: Path = ()
    lists: dict[Path, int] = {}
    for number, line in _outside_long_strings(text):
        header = _HEADER.fullmatch(line)
        if header:
            table = _within_lists(_keys(header[2]), lists)
            if header[1] == "[[":
                lists[table] = lists.get(table, -1) + 1
                table = (*table, lists[table])
            places.setdefault(table, (number, line.index("[") + 1))
            continue
        key = _KEY.match(line)
        if key is None:
            continue
        path = (*table, *_keys(key[1]))
        places[path] = (number, key.end() + 1)
        if line[key.end() : key.end() + 1] == "{":
            # What stands in quotes may look like a key.
            plain = _QUOTED.sub(
                lambda quoted: quoted[0][0] + "_" * (len(quoted[0]) - 2) + quoted[0][-1], line
            )
            for inner in _INNER.finditer(plain, key.end()):
                places[(*path, *_keys(line[inner.start(1) : inner.end(1)]))] = (number, inner.end() + 1)
    return places


def nearest_place(path: Path, places: Mapping[Path, Place]) -> tuple[Place | None, bool]:
    """Return the place of a value, or of the nearest table around it, and whether it is that of the value itself."""
    for length in range(len(path), 0, -1):
        own = path[:length]
        # A table may have no header of its own, but one within it.
        place = places.get(own) or next((at for key, at in places.items() if key[:length] == own), None)
        if place is not None:
            return place, length == len(path)
    return None, False


def _within_lists(keys: Path, lists: Mapping[Path, int]) -> Path:
    """Return the keys of a header with the number of the list's last element behind each list that they lead through."""
    path: Path = ()
    for key in keys[:-1]:
        path = (*path, key)
        if path in lists:
            path = (*path, lists[path])
    return (*path, *keys[-1:])


_REMEDIES = {
    "Invalid value": "put text and expressions in quotes",
    "Illegal character '\\n'": "a quotation mark is missing at the end of the line",
    "Cannot overwrite a value": "the key occurs twice in its table",
    "Cannot declare": "the table occurs twice",
    "Expected '=' after a key": "write the line as KEY = VALUE",
    "Expected newline or end of document after a statement": "numbers have a decimal point, texts are written in quotes",
    "Unescaped": "write a backslash in quotes twice, or a path with /",
}
_POSITION = re.compile(r"(?P<what>.*) \(at (?P<place>line \d+, column \d+|end of document)\)", re.DOTALL)


def toml_tables(text: str, source: str, remedies: Mapping[str, str] = MappingProxyType({})) -> dict[str, Any]:
    """Return what a text holds; `remedies` say what to write instead of what an error begins with."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = _POSITION.fullmatch(str(error))
        place, what = ("", str(error)) if found is None else (f", {found['place']}", found["what"])
        remedy = next(
            (f"; {remedy}" for start, remedy in {**_REMEDIES, **remedies}.items() if what.startswith(start)),
            "",
        )
        raise InputError(f"{source}{place}: is not valid TOML: {what}{remedy}.") from None
    except RecursionError:
        raise InputError(f"{source}: is not valid TOML: its arrays are nested too deep.") from None
    except ValueError:
        # The only valid TOML that fails here is an integer with thousands of digits.
        raise InputError(f"{source}: contains an integer with too many digits to be read.") from None


def _keys(written: str) -> Path:
    try:
        content = tomllib.loads(f"{written} = 0")
    except tomllib.TOMLDecodeError:
        return (written.strip(),)
    keys: list[str | int] = []
    inner: object = content
    while isinstance(inner, dict):
        key, inner = next(iter(inner.items()))
        keys.append(key)
    return tuple(keys)


def _outside_long_strings(text: str) -> Iterator[tuple[int, str]]:
    fence = ""
    for number, line in enumerate(text.splitlines(), start=1):
        if fence:
            fence = "" if fence in line else fence
            continue
        yield number, line
        for mark in ('"""', "'''"):
            if line.count(mark) % 2:
                fence = mark
