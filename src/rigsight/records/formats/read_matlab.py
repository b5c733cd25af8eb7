"""Which channels does a MATLAB file of version 5, 6 or 7 hold?"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Load,
    Refused,
    check_count,
    columns_of,
)
from rigsight.records.formats.matlab_elements import (
    HEADER,
    DamagedError,
    Variable,
    begins_with_variable,
    declared_variables,
)
from rigsight.records.formats.matlab_names import NUMERIC, why_no_signal

Way = tuple[tuple[int, str], ...]
"""Elements of structs and their fields, from a variable to what is inside."""


def open_matlab(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a MATLAB file: arrays, and those in structs as ``struct/field`` or ``structs(2)/field``.

    MATLAB files state no units. Tables and timetables are objects that only MATLAB reads; they are refused by name.
    """
    _check_first(path)
    data = path.read_bytes()
    read: dict[str, Any] = {}

    def load(variable: str, way: Way) -> Load:
        def numbers() -> NDArray[Any]:
            if variable not in read:
                # One at a time: packed variables together may be larger than any memory.
                read.clear()
                read[variable] = _read(data, variable)
            content: NDArray[Any] = read[variable]
            for element, field in way:
                content = content.reshape(-1, order="F")[element][field]
            return content

        return numbers

    channels: list[Channel] = []
    refused: list[Refused] = []
    try:
        variables = list(declared_variables(data, path.name))
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(path.name) else f"{path.name}: {text}") from None
    for variable in variables:
        for name, part, way in _parts(variable.name, variable, ()):
            check_count(path.name, len(channels) + len(refused))
            found = _channels(name, part, load(variable.name, way))
            if isinstance(found, Refused):
                # MATLAB keeps the workspace of functions and objects under an empty name.
                refused += [found] if variable.name else []
            else:
                channels.extend(found)
    yield ChannelFile(tuple(channels), tuple(refused))


def _parts(name: str, variable: Variable, way: Way) -> Iterator[tuple[str, Variable, Way]]:
    """Yield a variable, or what is inside where it is a struct or an array of structs."""
    count = math.prod(variable.shape)
    if variable.kind != "struct" or not variable.fields:
        yield name, variable, way
        return
    per_element = len(variable.fields) // count
    for place, field in enumerate(variable.fields):
        element = place // per_element
        owner = name if count == 1 else f"{name}({element + 1})"
        yield from _parts(f"{owner}/{field.name}", field, (*way, (element, field.name)))


def _check_first(path: Path) -> None:
    """Refuse a file that begins with no variable before all of it is read."""
    with path.open("rb") as stream:
        head = stream.read(HEADER + 8)
    if len(head) == HEADER + 8 and not begins_with_variable(head):
        raise DamagedError("it does not begin with a variable")


def _channels(name: str, declared: Variable, load: Load) -> list[Channel] | Refused:
    if declared.kind not in NUMERIC:
        return Refused(name, why_no_signal(declared.kind))
    return columns_of(name, declared.shape, load)


def _read(data: bytes, variable: str) -> Any:
    from scipy.io import loadmat

    # The stream and not the path: what was checked is what is read.
    stream: Any = io.BytesIO(data)
    return loadmat(stream, variable_names=[variable])[variable]
