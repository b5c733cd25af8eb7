"""Which channels does a JSON file hold: rows of numbers, lists by name, or one object per line?"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.records.formats.channel import MOST_COLUMNS, Channel, ChannelFile, Refused, listed


def open_json(path: Path) -> Iterator[ChannelFile]:
    """Yield the lists of numbers of a JSON file, named by their keys; a row is an object or a list, and may hold others."""
    # JSON states no units.
    text = path.read_text(encoding="utf-8-sig")
    try:
        data = json.loads(text)
    except json.JSONDecodeError:
        data = [json.loads(line) for line in text.splitlines() if line.strip()]
    yield listed(path.name, _parts("", data))


def _parts(name: str, value: Any) -> Iterator[Channel | Refused]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _parts(f"{name}/{key}" if name else str(key), inner)
        return
    if not isinstance(value, list) or len(value) < 2:
        is_text = isinstance(value, str)
        yield Refused(
            name, "is empty" if value in ([], None) else "is text" if is_text else "holds a single number"
        )
        return
    kinds = {type(row) for row in value if row is not None}
    if kinds == {dict}:
        for key in dict.fromkeys(key for row in value if row is not None for key in row):
            column = [None if row is None else row.get(key) for row in value]
            yield from _parts(f"{name}/{key}" if name else str(key), column)
    elif kinds == {list}:
        widths = {len(row) for row in value if row is not None}
        if len(widths) > 1 or max(widths) > MOST_COLUMNS:
            yield Refused(name, "holds rows of different lengths, or more columns than signals have")
            return
        for i in range(max(widths)):
            column = [None if row is None else row[i] for row in value]
            yield from _parts(f"{name}(:,{i + 1})" if name else str(i + 1), column)
    elif kinds <= {int, float, bool} and kinds:
        # A missing number becomes NaN, and is told as such.
        numbers = np.array([np.nan if row is None else row for row in value], dtype=np.float64)
        yield Channel(name, numbers.size, lambda: numbers)
    else:
        yield Refused(name, "contains text" if kinds else "is empty")
