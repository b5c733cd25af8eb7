"""Which formats of measurement files are known beside delimited text, and how is each recognized?

This is the only list of them. The format ``key`` is read by the function ``open_<key>`` of the module ``read_<key>``, without a
``_hdf5`` at its end, which is imported when a file of that format is opened.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from rigsight.errors import InputError

if TYPE_CHECKING:
    from rigsight.records.formats.channel import ChannelFile


HEAD = 4096
"""Bytes at the beginning of a file that decide its format."""
LARGEST_FILE = 2_000_000_000


@dataclass(frozen=True)
class Format:
    """A format of measurement files."""

    key: str  # name of its reader
    name: str  # name in messages and results
    # Of its files, lower case; empty where another format with the same suffix stands for it.
    suffixes: tuple[str, ...]
    # Pattern that matches the first `HEAD` bytes of a file of this format, and of no other.
    signature: bytes
    package: str | None = None  # package that reads it; None where rigsight itself does
    # True if that package is written in C, so that a damaged file could crash it: it is called in a process
    # of its own.
    isolated: bool = False
    advice: str = ""  # sentence for a file with one of the suffixes and other content
    largest: int = LARGEST_FILE  # bytes that are read of a file
    repair: str = ""  # sentence for a file that is cut short or damaged
    extra: str = "formats"  # extra of rigsight that installs the package


_HDF5 = rb"(?:.{512}|.{1024}|.{2048})?\x89HDF\r\n\x1a\n"
_OF_MATLAB_7_3 = rb"MATLAB 7\.3 MAT-file"
FORMATS = (
    Format(
        "matlab", "MATLAB", (".mat",), rb"(?!%b).{124}(?:\x00\x01|\x01\x00)(?:IM|MI)" % _HDF5, "scipy", isolated=True,
        advice="MATLAB files before version 5 are not read: save it again with save -v7.",
    ),
    Format("matlab_hdf5", "MATLAB 7.3", (), rb"(?=%b)%b" % (_HDF5, _OF_MATLAB_7_3), "h5py", isolated=True),
    Format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf"), rb"(?!%b)%b" % (_OF_MATLAB_7_3, _HDF5), "h5py", isolated=True),
    Format("mdf", "MDF4", (".mf4", ".mdf"), rb"MDF     |UnFinMF ", "asammdf", isolated=True),
    Format("tdms", "TDMS", (".tdms",), rb"TDS[mh]", "nptdms"),
    Format("parquet", "Parquet", (".parquet",), rb"PAR1", "pyarrow", isolated=True),
    # Bags hold images as well, which are passed over.
    Format(
        "bag", "ROS bag", (".bag", ".mcap", ".db3"), rb"#ROSBAG V2\.0|\x89MCAP0\r\n|SQLite format 3\x00", "rosbags",
        extra="logs", largest=200_000_000_000,
        repair="A recording that was cut off is repaired by 'mcap recover', 'ros2 bag reindex' or 'rosbag reindex'.",
    ),
    Format("ulog", "ULog", (".ulg",), rb"ULog\x01\x12\x35", "pyulog", extra="logs"),
    # pyuff holds every number of a text dataset as an object, thirty times the file.
    Format(
        "uff", "UFF", (".uff", ".unv"), rb"[\r\n]*    -1\s*[\r\n]\s*\d", "pyuff",
        largest=300_000_000,
    ),
    # Every number becomes an object, ten times the file. A line in brackets may also be the head of a section in a text.
    Format(
        "json", "JSON", (".json", ".jsonl", ".ndjson"), rb"(?:\xef\xbb\xbf)?\s*(?:\[\s*[\[{]|\{\s*\")",
        largest=300_000_000,
    ),
)  # fmt: skip
BY_SUFFIX = {suffix: known for known in FORMATS for suffix in known.suffixes}
MEASURED_SUFFIXES = (".csv", ".tsv", ".txt", ".dat", ".asc", ".lvm", *BY_SUFFIX)
"""Of files that are taken for measured ones, those of delimited text first."""

LOGS = frozenset(known.name for known in FORMATS if known.extra == "logs")
"""Names of the formats that robots alone log in."""


def recognized(head: bytes) -> Format | None:
    """Return the format of a file that begins with these bytes, None for delimited text."""
    return next((known for known in FORMATS if re.match(known.signature, head, re.DOTALL)), None)


def reader_of(key: str) -> Callable[[Path], Iterator[ChannelFile]]:
    """Return the function that reads a format; it and its library are imported no earlier than that."""
    reader: Callable[[Path], Iterator[ChannelFile]] = getattr(
        import_module(f"rigsight.records.formats.read_{key.removesuffix('_hdf5')}"), f"open_{key}"
    )
    return reader


def check_largest(path: Path, largest: int) -> None:
    """Refuse a file of more bytes than are read."""
    size = file_size(path)
    if size > largest:
        raise InputError(
            f"{path.name} has {size / 1e9:.1f} GB, more than the {largest / 1e9:g} GB that are read; "
            "split it into several records or reduce the sample rate."
        )


def file_size(path: Path, what: str = "the file") -> int:
    """Return the size of a file in bytes."""
    try:
        found = path.stat()
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; check the path.") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "this is not a file name"
        raise InputError(f"{path} cannot be read: {reason}.") from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path} is a folder; name {what} in it.")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(
            f"{path} is a device or a pipe, not a regular file; save its contents as a file first."
        )
    return found.st_size
