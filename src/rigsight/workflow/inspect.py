"""The work of `rigsight inspect`: a measured file -> an overview of its channels, and an entry for a campaign."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rigsight.errors import InputError
from rigsight.json_data import json_data
from rigsight.plot import channel_plots
from rigsight.records.channel_table import open_measurement
from rigsight.records.clocks import is_time
from rigsight.records.formats.channel import Channel, ChannelFile, Refused, as_floats, as_stamps
from rigsight.records.record import Floats
from rigsight.records.sensor_signs import FULL_TURNS, codes, held, is_wrapped, wrapping_counter
from rigsight.records.signals import clipping
from rigsight.records.stamps import step_and_gaps
from rigsight.rigs import RIGS, Rig
from rigsight.workflow.campaign.record_proposal import propose

if TYPE_CHECKING:
    from rigsight.plot import Figure

SCHEMA_VERSION = 1
_MOST_DRAWN = 40
"""Number of channels in a picture; a flight log holds hundreds."""


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


@dataclass(frozen=True)
class Inspection:
    """The contents of a file."""

    # Its name and the name of its format.
    file: str
    format: str
    channels: tuple[ChannelSummary, ...]  # in the order of the file
    # Channel that looks like time -> median step in its unit and number of gaps; None if it does not
    # increase.
    times: dict[str, tuple[float | None, int | None]]
    refused: tuple[Refused, ...]  # what else is in the file, and why it cannot be a signal
    model: str  # the rig that matches the channels best
    proposal: str  # ``[[records]]`` entry, with what must be checked as comments
    n_blanks: int  # values that are left to be filled in there
    notes: tuple[str, ...] = ()  # what was assumed of the file's layout, or what is missing of it

    def to_json(self) -> dict[str, Any]:
        """Return the contents for JSON."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "file": self.file,
            "format": self.format,
            "channels": self.channels,
            "times": {name: {"step": step, "n_gaps": gaps} for name, (step, gaps) in self.times.items()},
            "refused": self.refused,
            "notes": self.notes,
            "proposal": {"model": self.model, "toml": self.proposal, "n_blanks": self.n_blanks},
        }
        return json_data(content)


def run_inspect(path: str | Path, own_rigs: Iterable[Rig] = ()) -> Inspection:
    """Return the channels of a measured file of any supported format."""
    path = Path(path)
    with open_measurement(path) as file:
        file, channels = _readable(path, file)
        times = {c.name: step_and_gaps(as_stamps(c.load())) for c in file.channels if is_time(c.name)}
        if not channels:
            reasons = "; ".join(f"'{one.name}' {one.reason}" for one in file.refused[:5]) or "it is empty"
            raise InputError(f"{path.name} ({file.format}) contains no signal over time: {reasons}.")
        proposal = propose(path, file, (*own_rigs, *RIGS.values()))
    return Inspection(
        path.name,
        file.format,
        channels,
        times,
        file.refused,
        proposal.guess.rig.name,
        proposal.toml("estimation", '"validation" for records that are only scored'),
        proposal.n_blanks,
        (
            *file.notes,
            *dict.fromkeys(note for c in file.channels if c.axis is not None for note in c.axis.notes),
        ),
    )


def channel_picture(path: Path) -> Figure:
    """Return a plot of each channel of a file."""
    with open_measurement(path) as opened:
        file, _ = _readable(path, opened)
        time = next((channel for channel in file.channels if is_time(channel.name)), None)
        drawn = [channel for channel in file.channels if channel is not time] or list(file.channels)
        return channel_plots(drawn[:_MOST_DRAWN], time)


def _readable(path: Path, file: ChannelFile) -> tuple[ChannelFile, tuple[ChannelSummary, ...]]:
    """Return a file without the channels that cannot be read, and the summaries of the others."""
    read: list[tuple[Channel, ChannelSummary]] = []
    refused = list(file.refused)
    errors: list[InputError] = []
    for channel in file.channels:
        try:
            read.append((channel, _summary(channel)))
        except InputError as error:
            errors.append(error)
            reason = (
                str(error).removeprefix(path.name).lstrip(":, ").removeprefix(f"channel '{channel.name}': ")
            )
            refused.append(Refused(channel.name, reason.rstrip(".")))
    if errors and not read:
        raise errors[0]
    channels = tuple(channel for channel, _ in read)
    return replace(file, channels=channels, refused=tuple(refused)), tuple(own for _, own in read)


def _summary(channel: Channel) -> ChannelSummary:
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
