"""Detection of the format of a file, and opening it such that a damaged file gives a single clear message."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np

from rigsight.errors import InputError
from rigsight.records.formats.channel import Channel, ChannelFile, Load, check_count, check_size, check_total
from rigsight.records.formats.isolated_reader import PACKAGES, ReadingError, open_isolated
from rigsight.records.formats.ordinary_file import file_size

LARGEST_FILE = 2_000_000_000
MEND = "Export it again, or as CSV."
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEAD = 4096
_SUFFIXES = {
    ".mat": "matlab",
    ".h5": "hdf5",
    ".hdf5": "hdf5",
    ".hdf": "hdf5",
    ".mf4": "mdf",
    ".mdf": "mdf",
    ".tdms": "tdms",
    ".parquet": "parquet",
    ".uff": "uff",
    ".unv": "uff",
}
_NAMES = {
    "matlab": "MATLAB",
    "matlab_hdf5": "MATLAB 7.3",
    "hdf5": "HDF5",
    "mdf": "MDF4",
    "tdms": "TDMS",
    "parquet": "Parquet",
    "uff": "UFF",
}
SUFFIXES = tuple(_SUFFIXES)
"""Of the formats other than delimited text."""


def file_format(path: Path) -> str | None:
    """Return the format that the content of a file shows, whatever it is called; None for delimited text.

    Raises
    ------
    InputError
        If the file cannot be read, or its name promises a format that its content is not.
    """
    file_size(path)
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    found = _by_content(head)
    promised = _SUFFIXES.get(path.suffix.lower())
    if found is None and promised is not None:
        what = (
            "is empty" if not head else f"is no {_NAMES[promised]} file inside, or its beginning is damaged"
        )
        older = (
            " MATLAB files before version 5 are not read: save it again with save -v7."
            if promised == "matlab"
            else ""
        )
        raise InputError(
            f"{path.name} {what}.{older} Export it again; delimited text needs the suffix .csv or .txt."
        )
    return found


def _by_content(head: bytes) -> str | None:
    if any(head[start : start + 8] == _HDF5 for start in (0, 512, 1024, 2048)):
        return "matlab_hdf5" if head.startswith(b"MATLAB 7.3 MAT-file") else "hdf5"
    if head[126:128] in (b"IM", b"MI") and head[124:126] in (b"\x00\x01", b"\x01\x00"):
        return "matlab"
    if head.startswith((b"MDF     ", b"UnFinMF ")):
        return "mdf"
    if head.startswith((b"TDSm", b"TDSh")):
        return "tdms"
    if head.startswith(b"PAR1"):
        return "parquet"
    lines = head.lstrip(b"\r\n").splitlines()
    if len(lines) > 1 and lines[0].rstrip() == b"    -1" and lines[1][:6].strip().isdigit():
        return "uff"
    return None


@contextlib.contextmanager
def open_channels(path: Path) -> Iterator[ChannelFile]:
    """Open a measurement file that is no delimited text; its channels can be read inside this context.

    Parameters
    ----------
    path
        A file for which `file_format` names a format.

    Raises
    ------
    InputError
        Naming the file: too large, damaged, or a library is missing that reads it.
    """
    kind = file_format(path)
    if kind is None:
        raise InputError(f"{path.name} is not a measurement file of a known format.")
    name = _NAMES[kind]
    size = file_size(path)
    if size > LARGEST_FILE:
        raise InputError(
            f"{path.name} has {size / 1e9:.1f} GB, more than the {LARGEST_FILE / 1e9:g} GB that are read; "
            "split it into several records or reduce the sample rate."
        )
    with contextlib.ExitStack() as stack:
        stack.enter_context(_silence())
        with _told(path, name):
            file = stack.enter_context(_reader(kind)(path))
            check_count(path.name, len(file.channels))
            check_total(path.name, sum(channel.n_samples for channel in file.channels))
        channels = tuple(_guarded(path, name, channel) for channel in file.channels)
        yield replace(file, channels=channels)


def _reader(kind: str) -> Callable[[Path], AbstractContextManager[ChannelFile]]:
    """Return the reader of a format; only its own library is imported."""
    if kind in PACKAGES:
        return contextlib.contextmanager(partial(open_isolated, kind))
    reader = getattr(import_module(f"rigsight.records.formats.read_{kind}"), f"open_{kind}")
    return contextlib.contextmanager(reader)


def _guarded(path: Path, name: str, channel: Channel) -> Channel:
    """Return the channel with its reading checked: before for size, after for what came."""

    def guarded(load: Load, n_samples: int, what: str) -> Load:
        def checked() -> np.ndarray:
            check_size(path.name, channel.name, n_samples)
            with _told(path, name):
                samples = np.asarray(load())
                if samples.dtype.kind not in "fiub" or samples.ndim != 1:
                    raise ValueError(f"{what} is of type {samples.dtype}, shape {samples.shape}")
            if samples.size != n_samples:
                raise InputError(
                    f"{path.name}, channel '{channel.name}': {samples.size} of {n_samples} samples are present; the file is "
                    f"truncated or damaged. {MEND}"
                )
            return samples

        return checked

    axis = channel.axis
    if axis is not None and axis.load is not None:
        axis = replace(axis, load=guarded(axis.load, axis.n_samples, "time"))
    return replace(channel, load=guarded(channel.load, channel.n_samples, "data"), axis=axis)


@contextlib.contextmanager
def _told(path: Path, name: str) -> Iterator[None]:
    """Turn whatever a library raises over a damaged file into one message."""
    try:
        yield
    except InputError:
        raise
    except ImportError as error:
        raise InputError(
            f"{path.name} is a {name} file; reading it needs the package {error.name or 'that reads it'}: "
            'pip install "rigsight[formats]".'
        ) from None
    except MemoryError as error:
        raise InputError(
            f"{path.name} needs more memory than {error.args[0] if error.args else 'there is'}, or is damaged. "
            "Split it into several records."
        ) from None
    except Exception as error:
        told = str(error) if isinstance(error, ReadingError) else f"{type(error).__name__}: {error}"
        reason = " ".join(told.split())[:200].removesuffix(":")
        raise InputError(
            f"{path.name} cannot be read as {name}: the file is truncated or damaged ({reason}). {MEND}"
        ) from None


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep libraries from telling their troubles to the log as well: one message is enough."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
