"""Which channels does a MATLAB file of version 5, 6 or 7 hold?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import Channel, ChannelFile, Refused, check_count, columns_of
from rigsight.records.formats.matlab_names import why_no_signal

_OF_SCIPY = ("__header__", "__version__", "__globals__", "__function_workspace__")
_OBJECTS = {"MatlabOpaque": "opaque", "MatlabFunction": "function", "MatlabObject": "object"}
_KINDS = {"U": "char", "S": "char", "c": "complex", "O": "cell"}
"""Kind of scipy's arrays -> MATLAB class of what is no signal."""


def open_matlab(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a MATLAB file: arrays, and those in structs as ``struct/field`` or ``structs(2)/field``.

    MATLAB files state no units. Tables and timetables are objects that only MATLAB reads; they are refused by name.
    """
    from scipy.io import loadmat

    channels: list[Channel] = []
    refused: list[Refused] = []
    # Not in the types of MATLAB (mat_dtype): for those scipy drops imaginary parts.
    for variable, content in loadmat(str(path), appendmat=False).items():
        if variable in _OF_SCIPY:
            continue
        for name, part in _parts(variable, content):
            check_count(path.name, len(channels) + len(refused))
            kind = _kind(part)
            found = columns_of(name, part.shape, _kept(part)) if kind is None else why_no_signal(kind)
            if isinstance(found, list):
                channels += found
            else:
                refused.append(found if isinstance(found, Refused) else Refused(name, found))
    yield ChannelFile(tuple(channels), tuple(refused))


def _parts(name: str, content: Any) -> Iterator[tuple[str, Any]]:
    """Yield a variable, or what is inside where it is a struct or an array of structs."""
    if _kind(content) != "struct" or content.size == 0:
        yield name, content
        return
    for place, element in enumerate(content.reshape(-1, order="F"), 1):
        owner = name if content.size == 1 else f"{name}({place})"
        for field in content.dtype.names:
            yield from _parts(f"{owner}/{field}", element[field])


def _kind(content: Any) -> str | None:
    """Return the MATLAB class of what is no signal, None for numbers."""
    if not isinstance(content, np.ndarray):
        return "sparse"
    if type(content).__name__ in _OBJECTS:
        return _OBJECTS[type(content).__name__]
    return "struct" if content.dtype.names else _KINDS.get(content.dtype.kind)


def _kept(content: NDArray[Any]) -> Any:
    return lambda: content
