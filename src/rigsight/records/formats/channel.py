"""A channel of a measurement file before it is mapped to a signal, and how its stored numbers become quantities."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.record import Floats

# CF conventions 1.11, chapter 8.1, and the NetCDF attribute conventions; NWB says conversion and offset for the same.
_CONVENTIONS = (("scale_factor", "add_offset"), ("conversion", "offset"))
_MISSING = ("_FillValue", "missing_value")
_MAY_CONVERT = re.compile(
    r"(?<![a-z])(scale|scaling|gain|factor|slope|sensitivity|calibration|offset|intercept|conversion|lsb)(?![a-z])",
    re.IGNORECASE,
)
"""Words of attributes that look like a conversion; in no convention, so that nobody knows in which direction it goes."""

MOST_SAMPLES = 50_000_000
"""Of one channel: 400 MB once read."""
MOST_CHANNELS = 20_000
MOST_SAMPLES_IN_ALL = 1_000_000_000
"""Of all channels of a file: more than an unpacked file of the largest size holds, and a packed one may claim anything."""
MOST_IN_TABLE = 4 * MOST_SAMPLES
"""Of one table in a file, which is read as a whole: 1.6 GB."""
MOST_COLUMNS = 64
"""Of one table in a file; a wider one is a matrix, not signals side by side."""
# Line ends and control signs, of which lists and files of plain text cannot hold any, and halves of signs.
_UNPRINTABLE = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
_NO_UNIT = {"", "-", "--", "none", "null", "n/a", "unknown", "unit"}

UNIT_NAMES = ("unit", "units", "Unit", "Units", "UNIT", "UNITS")

Load = Callable[[], NDArray[Any]]
"""Reads stored numbers as they are, shape (n_samples,), while the file is open."""


@dataclass(frozen=True)
class Stored:
    """What a file says of the numbers of a channel: ``quantity = scale * stored + offset``."""

    # From the stored number to the quantity, in the unit that the file states.
    scale: float = 1.0
    offset: float = 0.0
    missing: tuple[float, ...] = ()  # stored numbers that stand for no reading
    # Smallest and largest valid stored number.
    least: float = -math.inf
    most: float = math.inf
    unsigned: bool = False  # true if the numbers are unsigned, although their type says otherwise
    # Attributes that may be a conversion, as ``name = value``, but of no known convention.
    unclear: tuple[str, ...] = ()

    def quantity(self, stored: NDArray[Any]) -> NDArray[Any]:
        """Return the quantity, shape (n_samples,), NaN where the file says that a reading is missing or invalid."""
        if self == Stored(unclear=self.unclear):
            return stored
        if self.unsigned and stored.dtype.kind == "i":
            stored = stored.view(f"u{stored.dtype.itemsize}")
        # In single precision -9999.9 is the number next to it.
        alike = stored.dtype if stored.dtype.kind == "f" else np.dtype(np.float64)
        missing = np.isin(stored.astype(alike), np.array(self.missing).astype(alike))
        invalid = missing | (stored < self.least) | (stored > self.most)
        return np.where(invalid, np.nan, self.scale * stored.astype(np.float64) + self.offset)

    @property
    def note(self) -> str:
        """What was done to the numbers, empty where nothing was."""
        if (self.scale, self.offset) == (1.0, 0.0):
            return ""
        return f"{self.scale:.9g} * stored number + {self.offset:.9g}, as the file states"


AS_STORED = Stored()
"""Numbers that are the quantity."""


def stored_by(attributes: Mapping[str, Any]) -> Stored:
    """Return what the attributes of a dataset, a channel or a column say of its numbers."""
    numbers = {name: own for name, value in attributes.items() if (own := _numbers(value))}
    scale, offset = 1.0, 0.0
    known: set[str] = set()
    for scaled, added in _CONVENTIONS:
        # An offset of no convention may be added before or after scaling.
        if scaled in numbers or (added in numbers and added == "add_offset"):
            scale, offset = numbers.get(scaled, (1.0,))[0], numbers.get(added, (0.0,))[0]
            known = {scaled, added}
            break
    valid = numbers.get("valid_range", ())
    least, most = valid if len(valid) == 2 else (-math.inf, math.inf)
    unclear = [
        f"{name} = {own[0]:g}"
        for name, own in numbers.items()
        if name not in known
        and len(own) == 1
        and _MAY_CONVERT.search(name.replace("_", " "))
        and own[0] not in (0.0, 1.0)
    ]
    return Stored(
        scale,
        offset,
        tuple(value for name in _MISSING for value in numbers.get(name, ()) if not math.isnan(value)),
        numbers.get("valid_min", (least,))[0],
        numbers.get("valid_max", (most,))[0],
        str(_text(attributes.get("_Unsigned", ""))).lower() == "true",
        tuple(unclear),
    )


def _text(value: Any) -> Any:
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else value


def _numbers(value: Any) -> tuple[float, ...]:
    """Return the few numbers of an attribute, also where they are written as text; none of anything else."""
    value = _text(value)
    if isinstance(value, str):
        try:
            return (float(value),)
        except ValueError:
            return ()
    array = np.asarray(value)
    # An attribute of type empty has no shape.
    if array.dtype.kind not in "iuf" or not 0 < array.size <= 16:
        return ()
    return tuple(float(number) for number in array.reshape(-1))


class ReadingError(Exception):
    """What a library raised over a file in a process of its own, by kind and text."""


@dataclass(frozen=True, eq=False)
class TimeAxis:
    """The time of a channel, where the file keeps one beside the samples."""

    n_samples: int  # number of stamps
    # Sample time and first stamp of an even axis; `dt` is None where stamps are stored.
    dt: float | None = None
    t0: float = 0.0
    load: Load | None = None  # reads stored stamps; None for an even axis
    unit: str = "s"  # of dt, t0 and stamps
    # Moment from which they count, the same for all channels of a file; None where the file does not say.
    origin: np.datetime64 | None = None
    late: float = 0.0  # time from the stamps until a logger received them [s]; 0 where that is what they are
    notes: tuple[str, ...] = ()  # what was done to the stamps

    def stamps(self) -> Floats:
        """Return the time stamps, shape (n_samples,)."""
        if self.load is not None:
            return as_stamps(self.load())
        return self.t0 + (self.dt or 0.0) * np.arange(self.n_samples, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Channel:
    """Samples under a name."""

    name: str  # unique in an opened file; ``group/channel`` where the file has groups
    n_samples: int
    load: Load  # reads the samples: of a reader as they are stored, of an opened file as quantities
    unit: str | None = None  # what the file states, None where it states none
    axis: TimeAxis | None = None  # its own time; None where time is a channel like any other
    stored: Stored = AS_STORED  # how stored numbers become quantities
    origin: np.datetime64 | None = None  # of a channel of dates, the moment from which its seconds count
    label: str = ""  # what the file calls it; that is its name where it is not given

    def __post_init__(self) -> None:
        object.__setattr__(self, "label", self.label or self.name)

    @property
    def short_name(self) -> str:
        """The name without its group."""
        return self.name.rpartition("/")[2] or self.name

    @property
    def group(self) -> str:
        """The group, ``""`` where there is none."""
        return self.name.rpartition("/")[0]


@dataclass(frozen=True)
class Refused:
    """Something in a file that is no signal over time, and why."""

    name: str
    reason: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", printable(self.name))
        object.__setattr__(self, "reason", printable(self.reason))


@dataclass(frozen=True, eq=False)
class ChannelFile:
    """What a file holds, found out without reading any samples."""

    # In the order of the file; names are made distinct and printable by `open_channels`, not by a reader.
    channels: tuple[Channel, ...]
    refused: tuple[Refused, ...] = ()  # what else is in it
    format: str = ""  # plain name, ``"MATLAB"``; `open_channels` fills it in
    # Of a delimited text the line of each row, shape (n_rows,); what was assumed of its layout; whether it has a header; and how
    # some columns, by signal, are read at once, with blank cells or without.
    lines: NDArray[np.int64] | None = None
    notes: tuple[str, ...] = ()
    has_names: bool = True
    ahead: Callable[[Mapping[str, int], bool], None] | None = None

    @property
    def word(self) -> str:
        """What a channel is called in messages."""
        return "channel" if self.lines is None else "column"

    @property
    def row(self) -> str:
        """What a row is called in messages."""
        return "sample" if self.lines is None else "line"


def check_size(file: str, name: str, n_samples: int) -> None:
    """Refuse a channel that is too long, before it is read."""
    if n_samples > MOST_SAMPLES:
        raise InputError(
            f"{file}, channel '{name}': {n_samples} samples, more than the {MOST_SAMPLES} that are read. "
            "Split the record, or reduce the sample rate."
        )


def check_count(file: str, n_channels: int) -> None:
    """Refuse a file with more channels than any measurement has."""
    if n_channels > MOST_CHANNELS:
        raise InputError(
            f"{file} holds more than {MOST_CHANNELS} channels; export those that are needed into a file of their own."
        )


def check_total(file: str, n_samples: int) -> None:
    """Refuse a file whose channels together are too long, before any is read."""
    if n_samples > MOST_SAMPLES_IN_ALL:
        raise InputError(
            f"{file}: its channels have {n_samples} samples in total, more than the {MOST_SAMPLES_IN_ALL} that are read. "
            "Split the record, or export only the channels that are needed."
        )


def as_floats(samples: object) -> Floats:
    """Return stored numbers as floats, shape (n_samples,)."""
    return np.ascontiguousarray(np.asarray(samples).reshape(-1), dtype=np.float64)


def as_stamps(samples: object) -> Floats:
    """Return stored time as floats, shape (n_samples,)."""
    # Stamps in single precision are read as the decimal numbers that they print as: 0.1 was meant, not 0.10000000149.
    array = np.asarray(samples).reshape(-1)
    if array.dtype == np.float32:
        return np.array([float(str(stamp)) for stamp in array], dtype=np.float64)
    return as_floats(array)


def printable(text: str) -> str:
    """Return a text from a file with a replacement character for every sign that no name or unit has."""
    return _UNPRINTABLE.sub("\ufffd", text)


def columns_of(
    name: str, shape: tuple[int, ...], read: Load, unit: str | None = None, stored: Stored = AS_STORED
) -> list[Channel | Refused]:
    """Return the channels of a stored array, one of a vector, one per column of a table, or why it has none."""
    long, size = [length for length in shape if length != 1], math.prod(shape)
    if reason := too_short(size):
        return [Refused(name, reason)]
    if len(long) == 1:
        return [Channel(name, size, lambda: read().reshape(-1), unit, stored=stored)]
    if len(long) > 2 or min(long) > MOST_COLUMNS:
        return [Refused(name, f"is an array of shape {shape}, neither a vector nor a table of columns")]
    if size > MOST_IN_TABLE:
        why = f"is a table of {size} numbers, more than the {MOST_IN_TABLE} that are read of one"
        return [Refused(name, why)]

    def column(index: int) -> Load:
        return lambda: _upright(read())[:, index]

    return [
        Channel(f"{name}(:,{i + 1})", max(long), column(i), unit, stored=stored) for i in range(min(long))
    ]


def too_short(n_samples: int) -> str | None:
    """Return why so few samples are no channel, None where they are enough."""
    return None if n_samples > 1 else "holds a single number" if n_samples else "is empty"


def listed(file: str, parts: Iterable[Channel | Refused]) -> ChannelFile:
    """Return what a file holds, of parts that are found one after the other."""
    channels: list[Channel] = []
    refused: list[Refused] = []
    for part in parts:
        if isinstance(part, Refused):
            refused.append(part)
        else:
            channels.append(part)
        check_count(file, len(channels) + len(refused))
    return ChannelFile(tuple(channels), tuple(refused))


def kept_last(kept: dict[str, NDArray[Any]], name: str, read: Load) -> Load:
    """Return how an array is read once for all its columns; `kept` holds the array that was read last, and no other."""

    def samples() -> NDArray[Any]:
        if name not in kept:
            kept.clear()
            kept[name] = read()
        return kept[name]

    return samples


def _upright(table: NDArray[Any]) -> NDArray[Any]:
    table = np.squeeze(table)
    return table.T if table.shape[0] < table.shape[1] else table


def stated_unit(text: object) -> str | None:
    """Return a unit as a file states it, None for the ways of saying that there is none."""
    text = _text(text)
    if isinstance(text, np.ndarray) and text.size == 1:
        return stated_unit(text.reshape(-1)[0])
    if not isinstance(text, str):
        return None
    text = printable(re.sub(r"^\[(.*)\]$", r"\1", text.replace("\x00", "").strip()).strip())
    return None if text.lower() in _NO_UNIT else text


def unit_of(attributes: Mapping[str, Any], names: Sequence[str] = UNIT_NAMES) -> str | None:
    """Return the unit that a file states in one of some attributes."""
    return next((unit for name in names if (unit := stated_unit(attributes.get(name))) is not None), None)


def with_distinct_names(channels: Iterable[Channel]) -> tuple[Channel, ...]:
    """Return the channels with printable names, with a number behind each that is not the first of its name."""
    channels = tuple(channels)
    names = distinct_names([printable(channel.name) for channel in channels])
    return tuple(replace(own, name=name, label=name) for own, name in zip(channels, names, strict=True))


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return the names with a number behind each that is not the first of its kind."""
    taken, used, distinct = set(names), Counter[str](), []
    for own in names:
        used[own] += 1
        name = own
        while used[own] > 1 and name in taken:
            name = f"{own}_{used[own]}"
            used[own] += name in taken
        taken.add(name)
        distinct.append(name)
    return distinct
