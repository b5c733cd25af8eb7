"""Which channels does an MDF4 file (ASAM, automotive loggers) hold?"""

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
from rigsight.records.channel import (
    Channel,
    ChannelFile,
    Load,
    Refused,
    TimeAxis,
    check_count,
    stated_unit,
    with_distinct_names,
)
from rigsight.records.mdf_process import TIME

LONGEST_WAIT = 300.0
"""For one answer [s]; a damaged file can lead asammdf in a circle."""


def open_mdf(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of an MDF file of version 4, each with the time of its group.

    Channels whose conversion is a formula in text are refused: evaluating it would execute what the file says.
    """
    if importlib.util.find_spec("asammdf") is None:
        raise ModuleNotFoundError("asammdf is not installed", name="asammdf")
    with path.open("rb") as stream:
        if stream.read(12)[8:9] < b"4":
            raise InputError(
                f"{path.name} is an MDF file of version 2 or 3; save it as version 4.10 or newer."
            )
    with _Reader(path) as reader:
        channels: list[Channel] = []
        refused: list[Refused] = []
        check_count(path.name, reader.contents["n_channels"])
        groups = reader.contents["groups"]
        for number, group in enumerate(groups):
            n_samples = group["n_samples"]
            unit = stated_unit(group["time_unit"]) or "s"
            axis = TimeAxis(n_samples, load=reader.load(number, TIME), unit=unit)
            prefix = f"{group['name'] or f'group {number + 1}'}/" if len(groups) > 1 else ""
            for name, index, unit, reason in group["channels"]:
                if reason is not None:
                    refused.append(Refused(prefix + name, reason))
                else:
                    load = reader.load(number, index)
                    channels.append(Channel(prefix + name, n_samples, load, stated_unit(unit), axis))
        yield ChannelFile("MDF4", with_distinct_names(channels), tuple(refused))


class _Reader:
    """The process that reads, as long as the file is open."""

    def __init__(self, path: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "rigsight.records.mdf_process", str(path.resolve())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        self.contents: dict[str, Any] = {}

    def __enter__(self) -> _Reader:
        try:
            self.contents = self._answer()[0]
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                # Closing flushes what the process no longer takes.
                with contextlib.suppress(OSError):
                    pipe.close()
        self._process.wait()

    def load(self, group: int, index: int) -> Load:
        def samples() -> NDArray[Any]:
            assert self._process.stdin is not None
            self._process.stdin.write(f"{group} {index}\n".encode())
            self._process.stdin.flush()
            return self._answer()[1]

        return samples

    def _answer(self) -> tuple[dict[str, Any], NDArray[Any]]:
        """Return what the process says, and the samples that come with it."""
        assert self._process.stdout is not None
        watch = threading.Timer(LONGEST_WAIT, self._process.kill)
        watch.daemon = True
        watch.start()
        try:
            line = self._process.stdout.readline()
            if not line:
                raise ValueError("it makes the library that reads it crash, or run in circles")
            answer: dict[str, Any] = json.loads(line)
            if answer.get("error") == "MemoryError":
                raise MemoryError
            if "error" in answer:
                raise ValueError(f"{answer['error']}: {answer['reason']}")
            kind = np.dtype(answer.get("type", "<f8"))
            if kind.kind not in "iufb":
                raise ValueError(f"its data is of type {kind}")
            return answer, np.frombuffer(self._process.stdout.read(answer.get("n_bytes", 0)), dtype=kind)
        finally:
            watch.cancel()
