"""Which channels does an MDF4 file (ASAM, automotive loggers) hold?"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    TimeAxis,
    listed,
    stated_unit,
    too_short,
)

# Types of asammdf.blocks.v4_constants: numbers, and conversions that are formulas with numbers, not text.
_NUMBERS = range(6)
_NO_CONVERSION, _ALGEBRAIC, _LAST_NUMERIC = (None, 0), 3, 6
_FORMULA = "is converted by a text formula, which is not executed; export it with physical values"


def open_mdf(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of an MDF file of version 4, each with the time of its group."""
    # Channels whose conversion is a formula in text are refused: evaluating it would execute what the file says.
    from asammdf import MDF

    with path.open("rb") as stream:
        if stream.read(12)[8:9] < b"4":
            raise InputError(
                f"{path.name} is an MDF file of version 2 or 3; save it as version 4.10 or newer."
            )
        stream.seek(0)
        with MDF(stream) as file:
            yield listed(path.name, _parts(file))


def _parts(file: Any) -> Iterator[Channel | Refused]:
    for number, group in enumerate(file.groups):
        master = file.masters_db.get(number)
        n_samples = int(group.channel_group.cycles_nr)
        axis = _axis(file, group, number, master, n_samples)
        label = group.channel_group.acq_name or f"group {number + 1}"
        prefix = f"{label}/" if len(file.groups) > 1 else ""
        for index, channel in enumerate(group.channels):
            if index == master:
                continue
            name, reason = prefix + channel.name, _refusal(channel, n_samples, axis)
            unit = stated_unit(channel.unit) or stated_unit(getattr(channel.conversion, "unit", None))
            if reason is not None:
                yield Refused(name, reason)
            else:
                yield Channel(name, n_samples, partial(_samples, file, number, index), unit, axis)


def _axis(file: Any, group: Any, number: int, master: int | None, n_samples: int) -> TimeAxis | None:
    if master is None or _conversion(group.channels[master]) == _ALGEBRAIC:
        return None
    unit = stated_unit(group.channels[master].unit) or "s"
    # The times of all groups count from the start of the measurement.
    start = np.datetime64(file.header.start_time.astimezone(UTC).replace(tzinfo=None), "ns")
    return TimeAxis(n_samples, load=lambda: file.get_master(number), unit=unit, origin=start)


def _samples(file: Any, number: int, index: int) -> NDArray[Any]:
    # Left to itself, the library drops the invalid samples, and the others would move to other times.
    read, invalid = file.get(group=number, index=index, samples_only=True, ignore_invalidation_bits=True)
    if invalid is None or not np.any(invalid):
        return np.asarray(read)
    return np.where(np.asarray(invalid, dtype=bool), np.nan, read)


def _refusal(channel: Any, n_samples: int, axis: TimeAxis | None) -> str | None:
    """Return why a channel is no signal, None if it may be one."""
    conversion = _conversion(channel)
    if conversion == _ALGEBRAIC:
        return _FORMULA
    if channel.data_type not in _NUMBERS or (conversion not in _NO_CONVERSION and conversion > _LAST_NUMERIC):
        return "contains text, a list or other bytes, not numbers"
    return too_short(n_samples) or (None if axis is not None else "has no time")


def _conversion(channel: Any) -> int | None:
    return None if channel.conversion is None else int(channel.conversion.conversion_type)
