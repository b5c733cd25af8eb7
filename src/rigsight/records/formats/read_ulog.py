"""Which channels does a flight log of PX4 hold?"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.records.formats.channel import Channel, ChannelFile, Refused, TimeAxis, listed, too_short

_STAMPS = "timestamp"


def open_ulog(path: Path) -> Iterator[ChannelFile]:
    """Yield the fields of all topics, named ``topic/field``; a further instance of a topic has its number behind the name."""
    # Times count from the start of the autopilot.
    from pyulog import ULog

    # The library tells its troubles on stdout, where results belong.
    with contextlib.redirect_stdout(io.StringIO()):
        log = ULog(str(path))
    found = listed(path.name, _parts(log))
    cut = f"{path.name}: the log is cut short or damaged; what was written before that is read."
    yield replace(found, notes=(cut,)) if log.file_corruption else found


def _parts(log: Any) -> Iterator[Channel | Refused]:
    for topic in log.data_list:
        name = f"{topic.name}_{topic.multi_id}" if topic.multi_id else topic.name
        stamps = topic.data[_STAMPS]
        if reason := too_short(stamps.size):
            yield Refused(name, reason)
            continue
        axis = TimeAxis(stamps.size, load=partial(np.divide, stamps, 1e6))
        for field, samples in topic.data.items():
            if field == _STAMPS:
                continue
            if samples.dtype.kind in "iufb":
                yield Channel(f"{name}/{field}", samples.size, partial(np.asarray, samples), axis=axis)
            else:
                yield Refused(f"{name}/{field}", f"is of type {samples.dtype}, not numbers")
