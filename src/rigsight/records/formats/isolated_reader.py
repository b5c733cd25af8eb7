"""Reading a file in a separate process, so that a damaged file cannot crash this one."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import Channel, ChannelFile, Load, Refused, TimeAxis
from rigsight.records.formats.known import PACKAGES
from rigsight.records.formats.stored_numbers import Stored

LEAST_MEMORY, MEMORY_PER_BYTE, LARGEST_MEMORY = 1_000_000_000, 100, 8_000_000_000
"""What reading may take beside the libraries [bytes]: so much, and so much for every byte of the file, since files are packed."""
LEAST_WAIT, WAIT_PER_BYTE, LONGEST_WAIT = 30.0, 1e-6, 120.0
"""For one answer [s]: so long, and so much more for every byte of the file; a damaged file can lead a library in circles."""


def most_memory(path: Path) -> int:
    """Return how many bytes reading a file may take beside the libraries that read it."""
    return min(LEAST_MEMORY + MEMORY_PER_BYTE * path.stat().st_size, LARGEST_MEMORY)


class ReadingError(Exception):
    """What the process says that its library raised, by kind and text."""


def open_isolated(kind: str, path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a file that a process of its own reads, see `reader_process`."""
    package = PACKAGES[kind]
    if importlib.util.find_spec(package) is None:
        raise ModuleNotFoundError(f"{package} is not installed", name=package)
    with _Process(kind, path) as process:
        contents = process.answer()[0]
        axes = [
            TimeAxis(n_samples, load=process.load("axis", i), unit=unit, origin=_moment(origin))
            for i, (n_samples, unit, origin) in enumerate(contents["axes"])
        ]
        channels = tuple(
            Channel(
                name,
                n_samples,
                process.load("channel", i),
                unit,
                None if axis is None else axes[axis],
                Stored.of_json(stored),
                _moment(origin),
            )
            for i, (name, n_samples, unit, axis, stored, origin) in enumerate(contents["channels"])
        )
        yield ChannelFile(channels, tuple(Refused(*one) for one in contents["refused"]))


def _moment(text: str | None) -> np.datetime64 | None:
    return None if text is None else np.datetime64(text, "ns")


class _Process:
    """The process that reads, as long as the file is open."""

    def __init__(self, kind: str, path: Path) -> None:
        self._most_memory = most_memory(path)
        self._longest_wait = min(LEAST_WAIT + WAIT_PER_BYTE * path.stat().st_size, LONGEST_WAIT)
        # -P: the folder a user stands in must not lend its modules.
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-P",
                "-m",
                "rigsight.records.formats.reader_process",
                kind,
                str(path.resolve()),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                # Closing flushes what the process no longer takes.
                with contextlib.suppress(OSError):
                    pipe.close()
        self._process.wait()

    def load(self, what: str, index: int) -> Load:
        """Return how a channel or an axis is read."""

        def samples() -> NDArray[Any]:
            assert self._process.stdin is not None
            self._process.stdin.write(f"{what} {index}\n".encode())
            self._process.stdin.flush()
            return self.answer()[1]

        return samples

    def answer(self) -> tuple[dict[str, Any], NDArray[Any]]:
        """Return what the process says, and the samples that come with it."""
        assert self._process.stdout is not None
        watch = threading.Timer(self._longest_wait, self._process.kill)
        watch.daemon = True
        watch.start()
        try:
            line = self._process.stdout.readline()
            if not line:
                raise ReadingError("the library that reads it crashes or does not finish")
            answer: dict[str, Any] = json.loads(line)
            if answer.get("error") == "MemoryError":
                raise MemoryError(f"the {self._most_memory / 1e9:.2g} GB that a file of its size may take")
            if answer.get("error") == "InputError":
                raise InputError(answer["reason"])
            if "error" in answer:
                raise ReadingError(f"{answer['error']}: {answer['reason']}")
            kind = np.dtype(answer.get("type", "<f8"))
            if kind.kind not in "iufb":
                raise ReadingError(f"its data is of type {kind}")
            return answer, np.frombuffer(self._process.stdout.read(answer.get("n_bytes", 0)), dtype=kind)
        finally:
            watch.cancel()
