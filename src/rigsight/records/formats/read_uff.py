"""Which channels does a universal file (UFF) hold in its datasets 58?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Load,
    Refused,
    TimeAxis,
    check_count,
    check_size,
    listed,
    stated_unit,
)

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
    """Yield the time responses of a universal file, named by their ID line, or by node and direction where it says nothing."""
    # Frequency response functions and spectra are listed as refused: a record needs time.
    import pyuff

    with path.open("rb") as stream:
        stream.seek(-min(path.stat().st_size, 200), 2)
        if not stream.read().rstrip().endswith(b"-1"):
            raise ValueError("the last dataset has no end")
    file = pyuff.UFF(str(path))
    types = [int(kind) for kind in file.get_set_types()]
    if not types:
        raise ValueError("no dataset is complete")
    check_count(path.name, len(types))
    yield listed(path.name, (_part(path.name, file, i) for i, kind in enumerate(types) if kind == FUNCTION))


def _part(of: str, file: Any, number: int) -> Channel | Refused:
    header = file.read_sets(number, header_only=True)
    name, function = _name(header, number), int(header["func_type"])
    if int(header["abscissa_spec_data_type"]) not in (0, TIME_AXIS) or function not in (0, TIME_RESPONSE):
        what = _FUNCTIONS.get(function, f"a function of type {function}, not over time")
        return Refused(name, f"is {what}; a record needs the time data it was made from")
    if int(header["ord_data_type"]) not in _REAL:
        return Refused(name, "holds complex numbers")
    n_samples = int(header["num_pts"])
    check_size(of, name, n_samples)
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
