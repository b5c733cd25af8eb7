"""Reading a file in a separate process, so that a damaged file cannot crash this one.

asammdf, libhdf5, scipy and pyarrow read in C, and a damaged file can make them crash, loop forever or request all memory. The
process is this module as a program, with format and file as arguments: it tells the channels, then for every number of a channel
or axis on its stdin the samples.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import ChannelFile, Load, ReadingError, TimeAxis
from rigsight.records.formats.known import PACKAGES, reader_of

LEAST_MEMORY, MEMORY_PER_BYTE, LARGEST_MEMORY = 4_000_000_000, 100, 12_000_000_000
"""What reading may take with the libraries [bytes]: so much, and so much for every byte of the file, since files are packed."""
LONGEST_WAIT = 120.0
"""For one answer [s]: a damaged file can lead a library in circles."""
LONGEST_WORK = 600
"""Processor time [s], for a reader whose caller was killed."""


def open_isolated(kind: str, path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a file that a process of its own reads."""
    package = PACKAGES[kind]
    if importlib.util.find_spec(package) is None:
        raise ModuleNotFoundError(f"{package} is not installed", name=package)
    # -P: the folder a user stands in must not lend its modules.
    command = [sys.executable, "-P", "-m", __name__, kind, str(path.resolve())]
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
