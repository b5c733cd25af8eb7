"""Which channels does a TDMS file of LabVIEW hold?"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    TimeAxis,
    listed,
    stated_unit,
    stored_by,
    too_short,
    unit_of,
)
from rigsight.records.stamps import earliest, seconds_since

SCALES = (
    "Polynomial", "Linear", "RTD", "Strain", "Table", "Thermistor", "Thermocouple", "Add", "Subtract", "AdvancedAPI",
)  # fmt: skip
"""Types of scales that nptdms 1.10 applies; it passes over others with a line in its log."""
_SCALE_TYPE = re.compile(r"NI_Scale\[\d+\]_Scale_Type")
UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "unit", "Unit")


def open_tdms(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a TDMS file, named ``group/channel``."""
    # A waveform's own axis comes from ``wf_increment``, ``wf_start_time`` and ``wf_start_offset``, its unit from ``unit_string``.
    # Start times and channels of dates count in seconds from the earliest of the file.
    from nptdms import TdmsFile

    with TdmsFile.open(path) as file:
        if file.file_status.incomplete_final_segment:
            raise ValueError("the last segment is incomplete")
        yield listed(path.name, _parts(file))


def _parts(file: Any) -> Iterator[Channel | Refused]:
    every = [(group, channel) for group in file.groups() for channel in group.channels()]
    origin = earliest(moment for _, channel in every if (moment := _start(channel)) is not None)
    for group, channel in every:
        name, properties = f"{group.name}/{channel.name}", channel.properties
        kind = np.dtype(channel.dtype).kind
        if kind not in "iufM":
            yield Refused(name, "holds text or complex numbers" if len(channel) else "is empty")
        elif reason := too_short(len(channel)):
            yield Refused(name, reason)
        elif unknown := _unknown_scales(properties, group.properties, file.properties):
            what = f"has a scale of type {', '.join(unknown)}, which is not read; export scaled values"
            yield Refused(name, what)
        else:
            dated = origin if kind == "M" else None
            unit = "s" if kind == "M" else unit_of(properties, UNIT_PROPERTIES)
            # Properties of waveforms and of scales are known; the others a person wrote.
            said = {key: value for key, value in properties.items() if not key.startswith(("NI_", "wf_"))}
            axis, load = _axis(channel, origin), partial(_samples, channel, dated)
            yield Channel(name, len(channel), load, unit, axis, stored_by(said), dated)


def _unknown_scales(*owners: Mapping[str, Any]) -> list[str]:
    """Return the types of scales in force that the library leaves out, so that it would give the numbers unscaled."""
    # The scales of the first that has any are in force: of the channel, its group, or the file.
    for properties in owners:
        if not properties.get("NI_Number_Of_Scales") or properties.get("NI_Scaling_Status") == "scaled":
            continue
        types = {str(value) for name, value in properties.items() if _SCALE_TYPE.fullmatch(name)}
        return sorted(types.difference(SCALES))
    return []


def _samples(channel: Any, origin: np.datetime64 | None) -> NDArray[Any]:
    read: NDArray[Any] = channel[:]
    return seconds_since(read, origin) if read.dtype.kind in "mM" else read


def _start(channel: Any) -> np.datetime64 | None:
    """Return the moment of a channel's first sample: the first date of a channel of dates, or the start of a waveform."""
    if np.dtype(channel.dtype).kind == "M":
        return np.datetime64(channel[0]) if len(channel) else None
    start = channel.properties.get("wf_start_time")
    return start if isinstance(start, np.datetime64) and "wf_increment" in channel.properties else None


def _axis(channel: Any, origin: np.datetime64 | None) -> TimeAxis | None:
    properties = channel.properties
    increment = properties.get("wf_increment")
    if not isinstance(increment, int | float) or not increment > 0.0:
        return None
    offset = properties.get("wf_start_offset", 0.0)
    unit = stated_unit(properties.get("wf_xunit_string")) or "s"
    first = float(offset) if isinstance(offset, int | float) else 0.0
    start = _start(channel)
    is_dated = start is not None and not np.isnat(start) and origin is not None and unit == "s"
    if is_dated:
        first += float(seconds_since(np.array([start]), origin)[0])
    return TimeAxis(len(channel), float(increment), first, unit=unit, origin=origin if is_dated else None)
