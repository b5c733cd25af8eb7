"""Which channels does a file of any format hold, delimited text included, and what do they look like: rate, range, gaps?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.clocks import is_time
from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    as_floats,
    as_stamps,
    with_distinct_names,
)
from rigsight.records.formats.channel_file import file_format, open_channels
from rigsight.records.formats.layout import Layout, find_layout, kept_lines, read_text
from rigsight.records.sensor_signs import FULL_TURNS, codes, held, is_wrapped, wrapping_counter
from rigsight.records.signals import clipping

# Of the median step: a longer one is a gap.
_GAP = 1.5


@dataclass(frozen=True)
class ChannelSummary:
    """Summary of a channel in `rigsight inspect`."""

    # As stated in the file; None for no unit.
    name: str
    unit: str | None
    n_samples: int
    # Median step, first and last stamp of its own time axis, in that axis' unit; None where it has none, or
    # no finite one.
    dt: float | None
    t0: float | None
    t1: float | None
    # Of the finite samples; None without any.
    minimum: float | None
    maximum: float | None
    n_not_finite: int  # NaN, infinite or unreadable samples
    n_gaps: int | None  # places where its own time jumps; None where it has none
    n_stands: int  # number of steps without a change of the value
    # What the numbers are beside the quantity itself: converted, codes, wrapped, held.
    remarks: tuple[str, ...] = ()


def summarize(channel: Channel) -> ChannelSummary:
    """Return the summary of a channel of an open file."""
    samples = as_floats(channel.load())
    finite = samples[np.isfinite(samples)]
    dt = t0 = t1 = None
    n_gaps = None
    if channel.axis is not None:
        stamps = channel.axis.stamps()
        dt, n_gaps = step_and_gaps(stamps)
        t0, t1 = (float(stamp) if np.isfinite(stamp) else None for stamp in (stamps[0], stamps[-1]))
    return ChannelSummary(
        channel.name,
        channel.unit,
        channel.n_samples,
        dt,
        t0,
        t1,
        float(finite.min()) if finite.size else None,
        float(finite.max()) if finite.size else None,
        samples.size - finite.size,
        n_gaps,
        int(np.count_nonzero(np.diff(samples) == 0.0)),
        tuple(_remarks(channel, samples)) if finite.size == samples.size > 1 else (),
    )


def _remarks(channel: Channel, samples: NDArray[np.float64]) -> Iterator[str]:
    if channel.stored.note:
        yield f"values are {channel.stored.note}"
    if channel.stored.unclear:
        yield f"has {', '.join(channel.stored.unclear)}, which may be a conversion and is not applied"
    found = codes(samples)
    for code in found:
        yield (
            f"{code.value:.6g} stands for a missing or invalid reading ({code.samples.size}, first in row {code.samples[0] + 1})"
        )
    if found:
        return
    period = next((turn for turn in FULL_TURNS if is_wrapped(samples, turn)), None) or wrapping_counter(
        samples
    )
    if period is not None:
        yield f"begins again at the end of {period:.6g}: an angle or a counter; it is unwrapped if the signal is one"
    slow = held(samples)
    if slow is not None:
        yield f"changes every {slow.rows} rows only: a slower device, or a command that is held"
    for level, count in clipping(samples):
        yield f"looks clipped: {count} samples are exactly at its extreme {level:g}"


def step_and_gaps(stamps: NDArray[np.float64]) -> tuple[float | None, int | None]:
    """Return the median step of time stamps, shape (n_samples,), and how often they jump; None where they do not rise."""
    steps = np.diff(stamps)
    if steps.size == 0 or not np.all((steps > 0.0) & (steps < np.inf)):
        return None, None
    dt = float(np.median(steps))
    return dt, int(np.count_nonzero(steps > _GAP * dt))


def time_summary(channel: Channel) -> tuple[float | None, int | None]:
    """Return median step and number of gaps of a channel that holds time, see `step_and_gaps`."""
    return step_and_gaps(as_stamps(channel.load()))


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
