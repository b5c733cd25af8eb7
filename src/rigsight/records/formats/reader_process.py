"""A reader in a separate process.

asammdf, libhdf5, scipy and pyarrow read in C, and a damaged file can make them crash, loop forever or request all memory; the
calling process then gets a message instead. Run as ``python -P -m rigsight.records.formats.reader_process FORMAT FILE``: one line
of JSON describes the file; then every line ``channel INDEX`` or ``axis INDEX`` on stdin is answered by a line of JSON with type
and size of the samples, and their bytes.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

from rigsight.records.formats.channel import ChannelFile, TimeAxis
from rigsight.records.formats.isolated_reader import most_memory
from rigsight.records.formats.known import PACKAGES, reader_of

LONGEST_WORK = 600
"""Processor time [s]."""


def main(kind: str, path: Path) -> None:
    """Answer until stdin ends."""
    answers = os.fdopen(os.dup(1), "wb")
    # What libraries print must not come between the answers.
    os.dup2(2, 1)
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        # The calling process ends a reader that loops; if it was killed, nothing does.
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_WORK, LONGEST_WORK))
    reader = reader_of(kind)
    try:
        # Before the limit is set: memory that libraries reserve for their threads does not depend on the file.
        import_module(PACKAGES[kind])
        limit_memory(most_memory(path))
        with contextlib.contextmanager(reader)(path) as file:
            axes = list(dict.fromkeys(one.axis for one in file.channels if one.axis is not None))
            _answer(answers, _contents(file, axes))
            for line in sys.stdin:
                what, index = line.split()
                load = file.channels[int(index)].load if what == "channel" else axes[int(index)].stamps
                # One channel that cannot be read says nothing of the others.
                with _reported(answers):
                    samples = np.ascontiguousarray(load())
                    data = samples.tobytes()
                    _answer(answers, {"type": samples.dtype.str, "n_bytes": len(data)}, data)
    except Exception as error:
        _answer_error(answers, error)
    # Clearing up after a failure may fail as well.
    answers.flush()
    os._exit(0)


def limit_memory(more: int) -> None:
    """Let this process take so many bytes from now on and no more, where the system can be told so."""
    with contextlib.suppress(ImportError, ValueError, OSError, IndexError):
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5])
        limit = pages * resource.getpagesize() + more
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


@contextlib.contextmanager
def _reported(answers: IO[bytes]) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        _answer_error(answers, error)


def _answer_error(answers: IO[bytes], error: Exception) -> None:
    _answer(answers, {"error": type(error).__name__, "reason": str(error)})


def _answer(answers: IO[bytes], content: dict[str, Any], data: bytes = b"") -> None:
    answers.write(json.dumps(content).encode() + b"\n" + data)
    answers.flush()


def _contents(file: ChannelFile, axes: list[TimeAxis]) -> dict[str, Any]:
    return {
        "channels": [
            [
                one.name,
                one.n_samples,
                one.unit,
                None if one.axis is None else axes.index(one.axis),
                asdict(one.stored),
                None if one.origin is None else str(one.origin),
            ]
            for one in file.channels
        ],
        "axes": [
            [axis.n_samples, axis.unit, None if axis.origin is None else str(axis.origin)] for axis in axes
        ],
        "refused": [[one.name, one.reason] for one in file.refused],
    }


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
