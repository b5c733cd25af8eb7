"""Which channels does a file of any format hold, delimited text included, and what do they look like: rate, range, gaps?"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigsight.records.formats.channel import Channel, ChannelFile, as_floats, as_stamps
from rigsight.records.formats.channel_file import file_format, open_channels
from rigsight.records.formats.text_channels import TextColumns
from rigsight.records.record import Floats
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


def _remarks(channel: Channel, samples: Floats) -> Iterator[str]:
    if channel.stored.note:
        yield f"values are {channel.stored.note}"
    if channel.stored.unclear:
        yield f"has {', '.join(channel.stored.unclear)}, which may be a conversion and is not applied"
    found = codes(samples)
    for code in found:
        where = f"{code.samples.size}, first in row {code.samples[0] + 1}"
        yield f"{code.value:.6g} stands for a missing or invalid reading ({where})"
    if found:
        return
    turn = next((turn for turn in FULL_TURNS if is_wrapped(samples, turn)), None)
    period = turn or wrapping_counter(samples)
    if period is not None:
        yield f"begins again at the end of {period:.6g}: an angle or a counter; it is unwrapped if the signal is one"
    slow = held(samples)
    if slow is not None:
        yield f"changes every {slow.rows} rows only: a slower device, or a command that is held"
    for level, count in clipping(samples):
        yield f"looks clipped: {count} samples are exactly at its extreme {level:g}"


def step_and_gaps(stamps: Floats) -> tuple[float | None, int | None]:
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
    return nullcontext(TextColumns(path).tolerant()) if file_format(path) is None else open_channels(path)
