"""Which channels does a universal file (UFF) hold in its datasets 58?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Load,
    Refused,
    TimeAxis,
    check_count,
    check_size,
    stated_unit,
)

LARGEST_FILE = 300_000_000
"""In bytes: pyuff holds every number of a text dataset as an object, thirty times the file."""
FUNCTION, TIME_RESPONSE, TIME_AXIS = 58, 1, 17
_FUNCTIONS = {
    2: "an auto spectrum",
    3: "a cross spectrum",
    4: "a frequency response function",
    5: "a transmissibility",
    6: "a coherence",
    7: "an auto correlation",
    8: "a cross correlation",
    9: "a power spectral density",
    10: "an energy spectral density",
    11: "a probability density",
    12: "a spectrum",
}
_REAL = (2, 4)


def open_uff(path: Path) -> Iterator[ChannelFile]:
    """Yield the time responses of a universal file, named by their ID line, or by node and direction where it says nothing.

    Frequency response functions and spectra are listed as refused: a record needs time.
    """
    import pyuff

    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise InputError(
            f"{path.name} has {size / 1e6:.0f} MB, more than the {LARGEST_FILE / 1e6:g} MB that are read of a universal file. "
            "Export the record as MATLAB 7.3, TDMS or MDF4."
        )
    with path.open("rb") as stream:
        stream.seek(-min(size, 200), 2)
        if not stream.read().rstrip().endswith(b"-1"):
            raise ValueError("the last dataset has no end")
    file = pyuff.UFF(str(path))
    types = [int(kind) for kind in file.get_set_types()]
    check_count(path.name, len(types))
    channels: list[Channel] = []
    refused: list[Refused] = []
    for i, kind in enumerate(types):
        if kind != FUNCTION:
            continue
        header = file.read_sets(i, header_only=True)
        name = _name(header, i)
        function = int(header["func_type"])
        if int(header["abscissa_spec_data_type"]) not in (0, TIME_AXIS) or function not in (0, TIME_RESPONSE):
            what = _FUNCTIONS.get(function, f"a function of type {function}, not over time")
            refused.append(Refused(name, f"is {what}; a record needs the time data it was made from"))
        elif int(header["ord_data_type"]) not in _REAL:
            refused.append(Refused(name, "holds complex numbers"))
        else:
            channels.append(_channel(path, file, i, name, header))
    if not types:
        raise ValueError("no dataset is complete")
    yield ChannelFile(tuple(channels), tuple(refused))


def _channel(path: Path, file: Any, number: int, name: str, header: dict[str, Any]) -> Channel:
    n_samples = int(header["num_pts"])
    check_size(path.name, name, n_samples)
    read: list[dict[str, Any]] = []

    def part(key: str) -> Load:
        def samples() -> NDArray[Any]:
            if not read:
                read.append(file.read_sets(number))
            # A line end after binary data may look like one more number.
            return np.asarray(read[0][key])[:n_samples]

        return samples

    unit = stated_unit(header.get("abscissa_axis_units_lab")) or "s"
    if int(header["abscissa_spacing"]) == 1:
        axis = TimeAxis(n_samples, float(header["abscissa_inc"]), float(header["abscissa_min"]), unit=unit)
    else:
        axis = TimeAxis(n_samples, load=part("x"), unit=unit)
    return Channel(name, n_samples, part("data"), stated_unit(header.get("ordinate_axis_units_lab")), axis)


def _name(header: dict[str, Any], number: int) -> str:
    text = str(header.get("id1", "")).strip()
    if text and text.upper() != "NONE":
        return text
    node, direction = header.get("rsp_node"), header.get("rsp_dir")
    return f"{node}:{direction}" if node else f"function {number + 1}"
