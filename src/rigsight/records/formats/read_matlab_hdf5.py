"""Which channels does a MATLAB file of version 7.3 hold, which is HDF5 inside?"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    check_count,
    columns_of,
    kept_last,
)
from rigsight.records.formats.matlab_names import DEEPER, DEEPEST, NUMERIC, why_no_signal

_INTERNAL = ("#refs#", "#subsystem#")


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
