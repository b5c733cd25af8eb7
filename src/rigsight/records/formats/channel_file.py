"""Detection of the format of a file, and opening it such that a damaged file gives a single clear message.

asammdf, libhdf5, scipy and pyarrow read in C, and a damaged file can make them crash, loop forever or request all memory. They
read in a process of their own, which is this module as a program, with format and file as arguments: it tells the channels, then
for every number of a channel or axis on its stdin the samples.
"""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import os
import pickle
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    AS_STORED,
    Channel,
    ChannelFile,
    Load,
    ReadingError,
    Stored,
    TimeAxis,
    check_size,
    check_total,
    with_distinct_names,
)
from rigsight.records.formats.known import (
    BY_SUFFIX,
    HEAD,
    Format,
    check_largest,
    file_size,
    reader_of,
    recognized,
)

MEND = "Export it again, or as CSV."
LEAST_MEMORY, MEMORY_PER_BYTE, LARGEST_MEMORY = 4_000_000_000, 100, 12_000_000_000
"""What reading may take with the libraries [bytes]: so much, and so much for every byte of the file, since files are packed."""
LONGEST_WAIT = 120.0
"""For one answer [s]: a damaged file can lead a library in circles."""
LONGEST_WORK = 600
"""Processor time [s], for a reader whose caller was killed."""


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
            reader = partial(open_isolated, known) if known.isolated else reader_of(known.key)
            file = stack.enter_context(contextlib.contextmanager(reader)(path))
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


def open_isolated(known: Format, path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a file that a process of its own reads."""
    if importlib.util.find_spec(str(known.package)) is None:
        raise ModuleNotFoundError(f"{known.package} is not installed", name=known.package)
    # -P: the folder a user stands in must not lend its modules.
    command = [sys.executable, "-P", "-m", __name__, known.key, str(path.resolve())]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    try:
        file: ChannelFile = _answer(process)
        yield _with_loads(file, partial(partial, _ask, process))
    finally:
        process.kill()
        # Closing flushes what the process no longer takes.
        with contextlib.suppress(OSError):
            process.communicate()


def _ask(process: subprocess.Popen[bytes], number: int) -> NDArray[Any]:
    assert process.stdin is not None
    process.stdin.write(b"%d\n" % number)
    process.stdin.flush()
    samples: NDArray[Any] = _answer(process)
    return samples


def _answer(process: subprocess.Popen[bytes]) -> Any:
    assert process.stdout is not None
    watch = threading.Timer(LONGEST_WAIT, process.kill)
    watch.daemon = True
    watch.start()
    try:
        answer = pickle.load(process.stdout)
    except (EOFError, pickle.UnpicklingError):
        raise ReadingError("the library that reads it crashes or does not finish") from None
    finally:
        watch.cancel()
    if isinstance(answer, Exception):
        raise answer
    return answer


def _with_loads(file: ChannelFile, turned: Callable[[Any], Any]) -> ChannelFile:
    """Return a file in which what reads samples is replaced."""
    axes = dict.fromkeys(one.axis for one in file.channels if one.axis is not None)
    on: dict[TimeAxis | None, TimeAxis | None] = {None: None}
    on |= {axis: axis if axis.load is None else replace(axis, load=turned(axis.load)) for axis in axes}
    channels = [replace(one, load=turned(one.load), axis=on[one.axis]) for one in file.channels]
    return replace(file, channels=tuple(channels))


def limit(most_memory: int) -> None:
    """Limit memory and processor time of this process, where the system can be told so."""
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (most_memory, most_memory))
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_WORK, LONGEST_WORK))


def main(kind: str, path: Path) -> None:
    """Answer until stdin ends."""
    answers = os.fdopen(os.dup(1), "wb")
    # What libraries print must not come between the answers.
    os.dup2(2, 1)
    most = min(LEAST_MEMORY + MEMORY_PER_BYTE * path.stat().st_size, LARGEST_MEMORY)
    limit(most)
    loads: list[Load] = []

    def number_of(load: Load) -> int:
        loads.append(load)
        return len(loads) - 1

    def tell(work: Callable[[], Any]) -> None:
        try:
            answer = pickle.dumps(work())
        except InputError as error:
            answer = pickle.dumps(error)
        except MemoryError:
            answer = pickle.dumps(MemoryError(f"the {most / 1e9:.2g} GB that a file of its size may take"))
        except Exception as error:
            answer = pickle.dumps(ReadingError(f"{type(error).__name__}: {error}"))
        answers.write(answer)
        answers.flush()

    with contextlib.ExitStack() as stack:
        reader = contextlib.contextmanager(reader_of(kind))
        tell(lambda: _with_loads(stack.enter_context(reader(path)), number_of))
        for line in sys.stdin:
            # One channel that cannot be read says nothing of the others.
            tell(loads[int(line)])


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
