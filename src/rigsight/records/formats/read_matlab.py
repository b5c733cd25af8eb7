"""Which channels does a MATLAB file hold: of version 5, 6 or 7, or of version 7.3, which is HDF5 inside?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    check_count,
    columns_of,
    kept_last,
)

NUMERIC = (
    "double",
    "single",
    "int8",
    "uint8",
    "int16",
    "uint16",
    "int32",
    "uint32",
    "int64",
    "uint64",
)
DEEPEST = 16
"""Structs in structs that are looked into."""
DEEPER = f"lies more than {DEEPEST} structs deep. Save its fields as variables of their own"
_REASONS = {
    "char": "is text",
    "logical": "is of type logical",
    "cell": "is a cell array, or an array of structs saved with -v7.3; save its contents as variables of their own",
    "struct": "is a struct without fields",
    "sparse": "is a sparse matrix",
    "complex": "holds complex numbers",
    "function": "is a function, which is not read",
    "object": "is an object, which is not read; save its values as plain arrays",
    "opaque": "is a table, timetable, timeseries or another object, which only MATLAB reads; "
    "save its columns as plain arrays",
}

_OF_SCIPY = ("__header__", "__version__", "__globals__", "__function_workspace__")
_OBJECTS = {"MatlabOpaque": "opaque", "MatlabFunction": "function", "MatlabObject": "object"}
_KINDS = {"U": "char", "S": "char", "c": "complex", "O": "cell"}
"""Kind of scipy's arrays -> MATLAB class of what is no signal."""

_INTERNAL = ("#refs#", "#subsystem#")


def why_no_signal(kind: str) -> str:
    """Return why a variable of a MATLAB class is no signal; classes of MATLAB's own libraries are objects."""
    return _REASONS.get(kind, _REASONS["opaque"])


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


def open_matlab_hdf5(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a file saved with ``-v7.3``: arrays, and those in structs as ``struct/field``."""
    import h5py

    with h5py.File(path, "r") as file:
        channels: list[Channel] = []
        refused: list[Refused] = []
        kept: dict[str, NDArray[Any]] = {}

        def take(name: str, item: Any) -> None:
            check_count(path.name, len(channels) + len(refused))
            found = _channels(name, item, kept)
            if isinstance(found, Refused):
                refused.append(found)
            else:
                channels.extend(found)

        def look_into(group: Any, above: str, depth: int) -> None:
            for name in map(str, group):
                if name in _INTERNAL or group.get(name, getlink=True).__class__ is not h5py.HardLink:
                    continue
                item = group[name]
                if not isinstance(item, h5py.Group):
                    take(above + name, item)
                elif (kind := _class(item)) not in (None, "struct"):
                    # What is inside are the bytes of an object, or the parts of a sparse matrix.
                    refused.append(
                        Refused(above + name, why_no_signal("sparse" if kind in NUMERIC else str(kind)))
                    )
                elif depth == DEEPEST:
                    # A damaged file may hold a group inside itself.
                    check_count(path.name, len(channels) + len(refused))
                    refused.append(Refused(above + name, DEEPER))
                else:
                    look_into(item, f"{above}{name}/", depth + 1)

        look_into(file, "", 0)
        yield ChannelFile(tuple(channels), tuple(refused))


def _class(item: Any) -> str | None:
    kind = item.attrs.get("MATLAB_class")
    return kind.decode("ascii", errors="replace") if isinstance(kind, bytes) else kind and str(kind)


def _channels(name: str, dataset: Any, kept: dict[str, NDArray[Any]]) -> list[Channel] | Refused:
    kind = _class(dataset)
    if kind is None and dataset.dtype.itemsize == 1:
        # MATLAB marks every array of its own; Simulink keeps objects beside them.
        return Refused(name, "holds bytes of no MATLAB class")
    kind = kind or "double"
    if "MATLAB_empty" in dataset.attrs:
        return Refused(name, "is empty")
    if kind not in NUMERIC or dataset.dtype.kind not in "iuf":
        return Refused(name, why_no_signal(kind if kind not in NUMERIC else "complex"))
    if dataset.is_virtual or dataset.external:
        return Refused(name, "stores its data in another file, which is not read")
    return columns_of(name, dataset.shape, kept_last(kept, name, lambda: dataset[()]))
