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
_HDF5 = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class Format:
    """A format of measurement files."""

    key: str  # name of its reader
    name: str  # name in messages and results
    # Of its files, lower case; empty where another format with the same suffix stands for it.
    suffixes: tuple[str, ...]
    # Whether the first `HEAD` bytes of a file are those of this format; no two formats recognize the same
    # file.
    recognizes: Callable[[bytes], bool]
    package: str | None = None  # package that reads it; None where rigsight itself does
    # True if that package is written in C, so that a damaged file could crash it: it is called in a process
    # of its own.
    isolated: bool = False
    advice: str = ""  # sentence for a file with one of the suffixes and other content


def _is_hdf5(head: bytes) -> bool:
    return any(head[start : start + 8] == _HDF5 for start in (0, 512, 1024, 2048))


def _is_matlab_hdf5(head: bytes) -> bool:
    return _is_hdf5(head) and head.startswith(b"MATLAB 7.3 MAT-file")


def _is_plain_hdf5(head: bytes) -> bool:
    return _is_hdf5(head) and not _is_matlab_hdf5(head)


def _is_matlab(head: bytes) -> bool:
    signs = head[126:128] in (b"IM", b"MI") and head[124:126] in (b"\x00\x01", b"\x01\x00")
    return signs and not _is_hdf5(head)


def _is_mdf(head: bytes) -> bool:
    return head.startswith((b"MDF     ", b"UnFinMF "))


def _is_tdms(head: bytes) -> bool:
    return head.startswith((b"TDSm", b"TDSh"))


def _is_parquet(head: bytes) -> bool:
    return head.startswith(b"PAR1")


def _is_uff(head: bytes) -> bool:
    lines = head.lstrip(b"\r\n").splitlines()
    return len(lines) > 1 and lines[0].rstrip() == b"    -1" and lines[1][:6].strip().isdigit()


def _is_json(head: bytes) -> bool:
    # A line in brackets may also be the head of a section in a text.
    return re.match(rb"(?:\xef\xbb\xbf)?\s*(?:\[\s*[\[{]|\{\s*\")", head) is not None


FORMATS = (
    Format(
        "matlab",
        "MATLAB",
        (".mat",),
        _is_matlab,
        "scipy",
        isolated=True,
        advice="MATLAB files before version 5 are not read: save it again with save -v7.",
    ),
    Format("matlab_hdf5", "MATLAB 7.3", (), _is_matlab_hdf5, "h5py", isolated=True),
    Format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf"), _is_plain_hdf5, "h5py", isolated=True),
    Format("mdf", "MDF4", (".mf4", ".mdf"), _is_mdf, "asammdf", isolated=True),
    Format("tdms", "TDMS", (".tdms",), _is_tdms, "nptdms"),
    Format("parquet", "Parquet", (".parquet",), _is_parquet, "pyarrow", isolated=True),
    Format("uff", "UFF", (".uff", ".unv"), _is_uff, "pyuff"),
    Format("json", "JSON", (".json", ".jsonl", ".ndjson"), _is_json),
)

BY_SUFFIX = {suffix: known for known in FORMATS for suffix in known.suffixes}

PACKAGES = {known.key: known.package for known in FORMATS if known.isolated and known.package}
"""Format -> package that is called in a process of its own."""


def recognized(head: bytes) -> Format | None:
    """Return the format of a file that begins with these bytes, None for delimited text."""
    return next((known for known in FORMATS if known.recognizes(head)), None)


def reader_of(key: str) -> Callable[[Path], Iterator[ChannelFile]]:
    """Return the function that reads a format; it and its library are imported no earlier than that."""
    reader: Callable[[Path], Iterator[ChannelFile]] = getattr(
        import_module(f"rigsight.records.formats.read_{key.removesuffix('_hdf5')}"), f"open_{key}"
    )
    return reader


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
