"""What does asammdf say about a file? Asked in a process of its own.

asammdf reads in C, and a damaged file can make it crash, run in circles or ask for all memory; the process that asked then gets
a message instead. Run as ``python -P -m rigsight.records.mdf_process FILE``: one line of JSON tells what the file holds; then
every line ``GROUP INDEX`` on stdin (index -1: the time of the group) is answered by a line of JSON with type and number of the
samples, and their bytes.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import sys
import warnings
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.channel import MOST_CHANNELS

TIME = -1
LARGEST_MEMORY = 8_000_000_000
# Types of asammdf.blocks.v4_constants: numbers, and conversions that are formulas with numbers, not text.
_NUMBERS = range(6)
_NO_CONVERSION, _ALGEBRAIC, _LAST_NUMERIC = (None, 0), 3, 6


def main(path: Path) -> None:
    """Answer until stdin ends."""
    answers = os.fdopen(os.dup(1), "wb")
    # What libraries print must not come between the answers.
    os.dup2(2, 1)
    logging.disable(logging.CRITICAL)
    warnings.simplefilter("ignore")
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (LARGEST_MEMORY, LARGEST_MEMORY))
    try:
        from asammdf import MDF

        with path.open("rb") as stream, MDF(stream) as file:
            _answer(answers, _contents(file))
            for line in sys.stdin:
                group, index = map(int, line.split())
                samples = _samples(file, group, index)
                answer = {"type": samples.dtype.str, "n_bytes": samples.nbytes}
                _answer(answers, answer, samples.tobytes())
    except Exception as error:
        _answer(answers, {"error": type(error).__name__, "reason": str(error)[:200]})
    # asammdf's own clearing up may fail after a failure.
    answers.flush()
    os._exit(0)


def _answer(answers: IO[bytes], content: dict[str, Any], data: bytes = b"") -> None:
    answers.write(json.dumps(content).encode() + b"\n" + data)
    answers.flush()


def _contents(file: Any) -> dict[str, Any]:
    """Return the groups with their channels, and why some are no signals."""
    groups = []
    count = 0
    for number, group in enumerate(file.groups):
        master = file.masters_db.get(number)
        n_samples = int(group.channel_group.cycles_nr)
        channels = []
        for index, channel in enumerate(group.channels):
            count += 1
            if count > MOST_CHANNELS or index == master:
                continue
            conversion = channel.conversion
            unit = channel.unit or getattr(conversion, "unit", "")
            channels.append([channel.name, index, unit, _refusal(channel, n_samples, master is not None)])
        time = None if master is None else group.channels[master]
        if time is not None and _conversion(time) == _ALGEBRAIC:
            channels = [[name, index, unit, _FORMULA] for name, index, unit, _ in channels]
        groups.append(
            {
                "name": str(group.channel_group.acq_name or ""),
                "n_samples": n_samples,
                "time_unit": "" if time is None else time.unit,
                "channels": channels,
            }
        )
    return {"groups": groups, "n_channels": count}


_FORMULA = "is converted by a formula in text, which is not executed; export it with physical values"


def _refusal(channel: Any, n_samples: int, has_time: bool) -> str | None:
    """Return why a channel is no signal, None if it may be one."""
    conversion = _conversion(channel)
    if conversion == _ALGEBRAIC:
        return _FORMULA
    if channel.data_type not in _NUMBERS or (conversion not in _NO_CONVERSION and conversion > _LAST_NUMERIC):
        return "holds text, a list or other bytes, no numbers"
    if n_samples < 2:
        return "holds a single number" if n_samples else "is empty"
    return None if has_time else "has no time"


def _conversion(channel: Any) -> int | None:
    return None if channel.conversion is None else int(channel.conversion.conversion_type)


def _samples(file: Any, group: int, index: int) -> NDArray[Any]:
    samples = (
        file.get_master(group) if index == TIME else file.get(group=group, index=index, samples_only=True)[0]
    )
    return np.ascontiguousarray(samples)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
