"""Mutations of a tree of tables that keep the file format, and so reach code that random bytes never reach."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from typing import Any

NASTY: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2**31, 2**63, -(2**63), 10**400, 16**9000, 0.0, -0.0, 1e-320, 1e308, -1e308, math.inf, math.nan,
    "", " ", ".", "..", "/", "../x", "/etc/passwd", "\x00", "\ud800", "\n", '"', "'", ",", "\t", "|", "é", "a" * 300, "9**9**9",
    "__import__('os')", "t", "u", "psi", "y", "sweep.csv", "deg", "mA", "zoh", "band_limited", "validation", [], {}, [[]], [{}],
    {"name": "u"}, {"name": "u", "scale": 0.0}, {"name": 3, "unit": "mm"},
)  # fmt: skip
"""Values that stand where others should."""


def mutated(tree: Any, rng: random.Random, words: list[str]) -> Any:
    """Return a tree with one to four places changed: replaced, removed, doubled, renamed or nested."""
    holder = [json_copy(tree)]
    for _ in range(rng.randint(1, 4)):
        _change(holder, rng, words)
    return holder[0]


def json_copy(tree: Any) -> Any:
    """Return a copy whose tables and lists can be changed."""
    if isinstance(tree, dict):
        return {str(key): json_copy(value) for key, value in tree.items()}
    return [json_copy(value) for value in tree] if isinstance(tree, list) else tree


def _change(holder: list[Any], rng: random.Random, words: list[str]) -> None:
    container, key = rng.choice(_places(holder))
    manner = rng.randrange(8)
    if manner == 0:
        del container[key]
        holder[:] = holder or [None]
    elif manner == 1 and isinstance(container, dict):
        name = rng.choice([*words, *(one for one in NASTY if isinstance(one, str))])
        container[name] = container[key]
    elif manner == 2 and isinstance(container, list):
        container.append(json_copy(container[key]))
    elif manner == 3:
        deep: Any = container[key]
        for _ in range(rng.choice((1, 3, 40, 2000))):
            deep = [deep]
        container[key] = deep
    elif manner == 4 and isinstance(container[key], int | float) and not isinstance(container[key], bool):
        container[key] = (
            container[key] * rng.choice((-1, 0.5, 1000, 1e-12)) if abs(container[key]) < 1e300 else 1
        )
    elif manner == 5 and isinstance(container[key], str):
        container[key] = rng.choice([*words, container[key] + rng.choice("\x1b.,/ é\x00\ud800")])
    else:
        container[key] = json_copy(rng.choice(NASTY))


def _places(holder: list[Any]) -> list[tuple[Any, Any]]:
    found: list[tuple[Any, Any]] = []
    left: list[Any] = [holder]
    while left:
        one = left.pop()
        for key, value in one.items() if isinstance(one, dict) else enumerate(one):
            found.append((one, key))
            if isinstance(value, dict | list):
                left.append(value)
    return found or [(holder, 0)]


def json_text(tree: Any) -> str:
    """Return a tree as JSON, deeper than Python's own writer goes."""
    return _written(tree, lambda key: json.dumps(key) + ": ", _json_scalar)


def _json_scalar(value: Any) -> str:
    # Python writes no number of so many digits.
    return "1" + "0" * 9000 if isinstance(value, int) and value > 10**400 else json.dumps(value)


def toml_text(tree: Any) -> str:
    """Return a tree as TOML; tables inside the first level are written inline."""
    if not isinstance(tree, dict):
        return f"value = {_toml_value(tree)}\n"
    lines = [f"{_key(name)} = {_toml_value(value)}" for name, value in tree.items()]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name and name.isascii() and name.replace("_", "a").isalnum() else json.dumps(name)


def _toml_value(tree: Any) -> str:
    return _written(tree, lambda key: f"{_key(key)} = ", _toml_scalar)


def _toml_scalar(value: Any) -> str:
    if value is None:
        return "1979-05-27T07:32:00Z"
    if isinstance(value, float):
        return "nan" if math.isnan(value) else f"{value!r}"
    if isinstance(value, bool):
        return "true" if value else "false"
    return json.dumps(value) if isinstance(value, str) else _digits(value)


def _digits(value: int) -> str:
    return str(value) if abs(value) <= 10**400 else hex(value)


def _written(tree: Any, key: Callable[[str], str], scalar: Callable[[Any], str]) -> str:
    """Return a tree as text without recursion: nests go deeper than the interpreter's stack."""
    out: list[str] = []
    left: list[Any] = [("value", tree)]
    while left:
        what, one = left.pop()
        if what == "text":
            out.append(one)
        elif isinstance(one, dict):
            left.append(("text", "}"))
            for i, (name, value) in reversed(list(enumerate(one.items()))):
                left += [("value", value), ("text", (", " if i else "") + key(name))]
            left.append(("text", "{"))
        elif isinstance(one, list):
            left.append(("text", "]"))
            for i, value in reversed(list(enumerate(one))):
                left += [("value", value), ("text", ", " if i else "")]
            left.append(("text", "["))
        else:
            out.append(scalar(one))
    return "".join(out)
