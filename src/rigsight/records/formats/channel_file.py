"""Detection of the format of a file, and opening it such that a damaged file gives a single clear message."""

from __future__ import annotations

import contextlib
import logging
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    AS_STORED,
    Channel,
    ChannelFile,
    Load,
    ReadingError,
    Stored,
    check_count,
    check_size,
    check_total,
    with_distinct_names,
)
from rigsight.records.formats.isolated_reader import open_isolated
from rigsight.records.formats.known import (
    BY_SUFFIX,
    HEAD,
    PACKAGES,
    Format,
    check_largest,
    file_size,
    reader_of,
    recognized,
)

MEND = "Export it again, or as CSV."


def file_format(path: Path) -> Format | None:
    """Return the format that the content of a file shows, whatever it is called; None for delimited text."""
    file_size(path)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    found, promised = recognized(head), BY_SUFFIX.get(path.suffix.lower())
    if found is None and promised is not None:
        what = "is empty" if not head else f"is no {promised.name} file inside, or its beginning is damaged"
        advice = f" {promised.advice}" if promised.advice else ""
        raise InputError(
            f"{path.name} {what}.{advice} Export it again; delimited text needs the suffix .csv or .txt."
        )
    return found


@contextlib.contextmanager
def open_channels(path: Path) -> Iterator[ChannelFile]:
    """Open a measurement file that is no delimited text; its channels can be read inside this context."""
    known = file_format(path)
    if known is None:
        raise InputError(f"{path.name} is not a measurement file of a known format.")
    check_largest(path, known.largest)
    with contextlib.ExitStack() as stack:
        stack.enter_context(_silence())
        with _reported(path, known):
            # Only its own library is imported.
            isolated = known.key in PACKAGES
            reader = partial(open_isolated, known.key) if isolated else reader_of(known.key)
            file = stack.enter_context(contextlib.contextmanager(reader)(path))
            check_count(path.name, len(file.channels))
            check_total(path.name, sum(channel.n_samples for channel in file.channels))
            distinct = with_distinct_names(file.channels)
        channels = tuple(_guarded(path, known, channel) for channel in distinct)
        yield replace(file, channels=channels, format=known.name)


def _guarded(path: Path, known: Format, channel: Channel) -> Channel:
    """Return the channel with its reading checked: before for size, after for what came."""

    def guarded(load: Load, n_samples: int, what: str, stored: Stored = AS_STORED) -> Load:
        def checked() -> np.ndarray:
            check_size(path.name, channel.name, n_samples)
            with _reported(path, known):
                samples = np.asarray(load())
                if samples.dtype.kind not in "fiub" or samples.ndim != 1:
                    raise ValueError(f"{what} is of type {samples.dtype}, shape {samples.shape}")
            if samples.size != n_samples:
                raise InputError(
                    f"{path.name}, channel '{channel.name}': {samples.size} of {n_samples} samples are present; the file is "
                    f"truncated or damaged. {MEND}"
                )
            return stored.quantity(samples)

        return checked

    axis = channel.axis
    if axis is not None and axis.load is not None:
        axis = replace(axis, load=guarded(axis.load, axis.n_samples, "time"))
    load = guarded(channel.load, channel.n_samples, "data", channel.stored)
    return replace(channel, load=load, axis=axis)


@contextlib.contextmanager
def _reported(path: Path, known: Format) -> Iterator[None]:
    """Turn whatever a library raises over a damaged file into one message."""
    try:
        yield
    except InputError:
        raise
    except ImportError:
        raise InputError(
            f"{path.name} is a {known.name} file; reading it needs the package {known.package}: "
            f'pip install "rigsight[{known.extra}]".'
        ) from None
    except MemoryError as error:
        raise InputError(
            f"{path.name} needs more memory than {error.args[0] if error.args else 'there is'}, or is damaged. "
            "Split it into several records."
        ) from None
    except Exception as error:
        reported = str(error) if isinstance(error, ReadingError) else f"{type(error).__name__}: {error}"
        reason = " ".join(reported.split())[:200].removesuffix(":")
        raise InputError(
            f"{path.name} cannot be read as {known.name}: the file is truncated or damaged ({reason}). "
            f"{' '.join(filter(None, (known.repair, MEND)))}"
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
