"""Which columns does a delimited text file hold, seen as channels?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.clocks import is_time
from rigsight.records.formats.channel import Channel, ChannelFile, Refused, with_distinct_names
from rigsight.records.formats.channel_file import file_format, open_channels
from rigsight.records.formats.layout import Layout, find_layout, kept_lines
from rigsight.records.formats.text_file import read_text


def open_measurement(path: Path) -> AbstractContextManager[ChannelFile]:
    """Open a file of any format, delimited text included; its channels can be read inside this context."""
    return _open_text(path) if file_format(path) is None else open_channels(path)


@contextmanager
def _open_text(path: Path) -> Iterator[ChannelFile]:
    """Yield the columns of a text; a cell that is no number becomes NaN, so that it can be counted."""
    lines = read_text(path).split("\n")
    kept = kept_lines(lines)
    if not kept:
        raise InputError(f"{path.name} is empty: a header and rows of numbers are needed.")
    layout = find_layout(path, lines, kept, None, None, None, None)
    rows = [lines[number - 1] for number in kept[layout.n_above :]]
    if not rows:
        raise InputError(f"{path.name} has a header but no rows of numbers.")
    n_signs = sum(map(len, rows)) + len(rows)
    if len(rows) * len(layout.names) > n_signs:
        raise InputError(
            f"{path.name}: most of its {len(rows)} rows are shorter than the {len(layout.names)} columns of its header. "
            "Correct the file, or cut the record there."
        )
    table = _numbers(rows, layout)
    for i in range(len(layout.names)):
        if np.isfinite(table[:, i]).any():
            layout.refuse_thousands(path, i, lines, kept[layout.n_above :], table[:, i])
    channels: list[Channel] = []
    refused: list[Refused] = []
    for i, name in enumerate(layout.names):
        if np.isnan(table[:, i]).all():
            refused.append(Refused(name, "holds text"))
            continue
        # Columns without a name of their own are called by their number, also in a campaign; times belong to their signals.
        own = bool(name) and (layout.names.count(name) == 1 or is_time(name))
        channels.append(Channel(name if own else str(i + 1), table.shape[0], _load(table, i), layout.unit(i)))
    yield ChannelFile(with_distinct_names(channels), tuple(refused), "delimited text")


def _load(table: NDArray[np.float64], column: int) -> Any:
    return lambda: table[:, column]


def _numbers(rows: Sequence[str], layout: Layout) -> NDArray[np.float64]:
    """Return all columns, shape (n_rows, n_columns)."""
    dialect, width = layout.dialect, len(layout.names)
    texts = [row.replace(",", ".") for row in rows] if dialect.decimal == "," else rows
    try:
        table = np.loadtxt(
            texts,
            delimiter=None if dialect.separator == " " else dialect.separator,
            quotechar='"',
            comments=None,
            ndmin=2,
        )
        if table.shape[1] == width:
            return np.asarray(table, dtype=np.float64)
    except ValueError:
        pass
    table = np.full((len(rows), width), np.nan)
    for i, row in enumerate(rows):
        for j, cell in enumerate(dialect.cells(row)[:width]):
            number = dialect.number(cell)
            table[i, j] = np.nan if number is None else number
    return table
