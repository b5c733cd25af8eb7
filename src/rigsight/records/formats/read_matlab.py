"""Which channels does a MATLAB file hold: of version 5, 6 or 7, or of version 7.3, which is HDF5 inside?

MATLAB files state no units. Tables and timetables are objects that only MATLAB reads; they are refused by name.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import Channel, ChannelFile, Refused, columns_of, kept_last, listed

_NUMERIC = ("double", "single", *(f"{sign}int{size}" for size in (8, 16, 32, 64) for sign in ("", "u")))
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
"""MATLAB class -> why a variable of it is no signal; classes of MATLAB's own libraries are opaque."""
_OF_SCIPY = ("__header__", "__version__", "__globals__", "__function_workspace__")
_OBJECTS = {"MatlabOpaque": "opaque", "MatlabFunction": "function", "MatlabObject": "object"}
_KINDS = {"U": "char", "S": "char", "c": "complex", "O": "cell"}
"""Kind of scipy's arrays -> MATLAB class of what is no signal."""
_INTERNAL = ("#refs#", "#subsystem#")
_DEEPEST = 16
"""Structs in structs that are looked into: a damaged file may hold a group inside itself."""
_DEEPER = f"lies more than {_DEEPEST} structs deep. Save its fields as variables of their own"


def open_matlab(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a MATLAB file: arrays, and those in structs as ``struct/field`` or ``structs(2)/field``."""
    from scipy.io import loadmat

    # Not in the types of MATLAB (mat_dtype): for those scipy drops imaginary parts.
    variables = loadmat(str(path), appendmat=False).items()
    parts = (part for name, content in variables if name not in _OF_SCIPY for part in _parts(name, content))
    yield listed(path.name, parts)


def _parts(name: str, content: Any) -> Iterator[Channel | Refused]:
    """Yield the channels of a variable, or of what is inside where it is a struct or an array of structs."""
    kind = _kind(content)
    if kind is None:
        yield from columns_of(name, content.shape, lambda: content)
    elif kind != "struct" or content.size == 0:
        yield Refused(name, _REASONS[kind])
    else:
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


def open_matlab_hdf5(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of a file saved with ``-v7.3``: arrays, and those in structs as ``struct/field``."""
    import h5py

    with h5py.File(path, "r") as file:
        yield listed(path.name, _inside(file, "", 0, {}))


def _inside(group: Any, above: str, depth: int, kept: dict[str, NDArray[Any]]) -> Iterator[Channel | Refused]:
    import h5py

    for own in map(str, group):
        if own in _INTERNAL or group.get(own, getlink=True).__class__ is not h5py.HardLink:
            continue
        name, item = above + own, group[own]
        if not isinstance(item, h5py.Group):
            yield from _columns(name, item, kept)
        elif (kind := _class(item)) not in (None, "struct"):
            # What is inside are the bytes of an object, or the parts of a sparse matrix.
            yield Refused(name, _why("sparse" if kind in _NUMERIC else str(kind)))
        elif depth == _DEEPEST:
            yield Refused(name, _DEEPER)
        else:
            yield from _inside(item, f"{name}/", depth + 1, kept)


def _why(kind: str) -> str:
    return _REASONS.get(kind, _REASONS["opaque"])


def _class(item: Any) -> str | None:
    kind = item.attrs.get("MATLAB_class")
    return kind.decode("ascii", errors="replace") if isinstance(kind, bytes) else kind and str(kind)


def _columns(name: str, dataset: Any, kept: dict[str, NDArray[Any]]) -> list[Channel | Refused]:
    kind = _class(dataset)
    if kind is None and dataset.dtype.itemsize == 1:
        # MATLAB marks every array of its own; Simulink keeps objects beside them.
        return [Refused(name, "holds bytes of no MATLAB class")]
    kind = kind or "double"
    if "MATLAB_empty" in dataset.attrs:
        return [Refused(name, "is empty")]
    if kind not in _NUMERIC or dataset.dtype.kind not in "iuf":
        return [Refused(name, _why(kind if kind not in _NUMERIC else "complex"))]
    if dataset.is_virtual or dataset.external:
        return [Refused(name, "stores its data in another file, which is not read")]
    return columns_of(name, dataset.shape, kept_last(kept, name, lambda: dataset[()]))
