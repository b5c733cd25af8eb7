"""Which channels does an HDF5 file hold?"""

from __future__ import annotations

import contextlib
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
    listed,
    stored_by,
    unit_of,
)


def open_hdf5(path: Path) -> Iterator[ChannelFile]:
    """Yield the channels of an HDF5 file: every real dataset, named by its path, converted by its attributes."""
    # Time is a dataset like any other. Links into other files are not followed and references not resolved: a file that was
    # sent to someone must not read what is none of its business.
    import h5py

    with h5py.File(path, "r") as file:
        found: list[tuple[str | bytes, Any]] = []

        def visit(name: str | bytes, item: Any) -> None:
            check_count(path.name, len(found))
            if isinstance(item, h5py.Dataset):
                found.append((name, item))

        file.visititems(visit)
        kept: dict[str, NDArray[Any]] = {}
        yield listed(path.name, (part for name, item in found for part in _parts(name, item, kept)))


def _parts(stored: str | bytes, dataset: Any, kept: dict[str, NDArray[Any]]) -> list[Channel | Refused]:
    # A name that is no UTF-8 comes as bytes.
    name = stored.decode("utf-8", errors="replace") if isinstance(stored, bytes) else stored
    reason = _refusal(dataset)
    if reason is not None:
        return [Refused(name, reason)]
    attributes = _attributes(dataset)
    read = kept_last(kept, name, lambda: dataset[()])
    return columns_of(name, dataset.shape, read, unit_of(attributes), stored_by(attributes))


def _refusal(dataset: Any) -> str | None:
    """Return why a dataset is no channel, None if it may be one."""
    if dataset.shape is None:
        return "is empty"
    if dataset.dtype.kind == "O":
        return "contains text or object references, which are not read"
    if dataset.dtype.kind not in "iuf":
        return f"is of type {dataset.dtype}, not real numbers"
    if dataset.is_virtual or dataset.external:
        return "stores its data in another file, which is not read; copy the data into this one"
    return None


def _attributes(dataset: Any) -> dict[str, Any]:
    """Return the attributes that can be read; of some types, such as references of others, none can."""
    found = {}
    for name in dataset.attrs:
        with contextlib.suppress(OSError, TypeError, ValueError):
            found[str(name)] = dataset.attrs[name]
    return found
