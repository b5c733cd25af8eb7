"""The work of `rigsight inspect`: a measured file -> an overview of its channels, and an entry for a campaign."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rigsight.errors import InputError
from rigsight.json_data import json_data
from rigsight.plot import channel_plots
from rigsight.records.channel_names import closeness
from rigsight.records.channel_summary import ChannelSummary, open_measurement, summarize, time_summary
from rigsight.records.formats.channel import Channel, ChannelFile, Refused
from rigsight.records.read_record import TIME
from rigsight.rigs import RIGS, Rig
from rigsight.workflow.campaign.record_proposal import propose

if TYPE_CHECKING:
    from rigsight.plot import Figure

SCHEMA_VERSION = 1
_NAMED = 2.0
_MOST_DRAWN = 40
"""Number of channels in a picture; a flight log holds hundreds."""


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

    def to_json(self) -> dict[str, Any]:
        """Return the contents for JSON."""
        content = {
            "schema_version": SCHEMA_VERSION,
            "file": self.file,
            "format": self.format,
            "channels": self.channels,
            "times": {name: {"step": step, "n_gaps": gaps} for name, (step, gaps) in self.times.items()},
            "refused": self.refused,
            "proposal": {"model": self.model, "toml": self.proposal, "n_blanks": self.n_blanks},
        }
        return json_data(content)


def run_inspect(path: str | Path, own_rigs: Iterable[Rig] = ()) -> Inspection:
    """Return the channels of a measured file of any supported format."""
    path = Path(path)
    with open_measurement(path) as file:
        file, channels = _readable(path, file)
        times = {channel.name: time_summary(channel) for channel in file.channels if _is_time(channel)}
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
    )


def channel_picture(path: Path) -> Figure:
    """Return a plot of each channel of a file."""
    with open_measurement(path) as opened:
        file, _ = _readable(path, opened)
        time = next((channel for channel in file.channels if _is_time(channel)), None)
        drawn = [channel for channel in file.channels if channel is not time] or list(file.channels)
        return channel_plots(drawn[:_MOST_DRAWN], time)


def _is_time(channel: Channel) -> bool:
    return closeness(channel.name, TIME) >= _NAMED


def _readable(path: Path, file: ChannelFile) -> tuple[ChannelFile, tuple[ChannelSummary, ...]]:
    """Return a file without the channels that cannot be read, and the summaries of the others."""
    read: list[tuple[Channel, ChannelSummary]] = []
    refused = list(file.refused)
    errors: list[InputError] = []
    for channel in file.channels:
        try:
            read.append((channel, summarize(channel)))
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
