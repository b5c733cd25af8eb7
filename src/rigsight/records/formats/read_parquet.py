"""Which channels does a Parquet file hold?"""

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
    check_count,
    stated_unit,
    stored_by,
)
from rigsight.records.stamps import earliest, seconds_since

UNIT_KEYS = (b"unit", b"units", b"Unit", b"Units")


def open_parquet(path: Path) -> Iterator[ChannelFile]:
    """Yield the columns of numbers of a Parquet file; units from the metadata ``unit`` of a column.

    Time is a column like any other; dates and durations count in seconds from the first.
    """
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        schema = file.schema_arrow
        check_count(path.name, len(schema))
        n_rows = file.metadata.num_rows
        dated = [column.name for column in schema if _is_date(column.type)]
        origin = _origin(file, dated) if n_rows and len(set(schema.names)) == len(schema.names) else None
        channels: list[Channel] = []
        refused: list[Refused] = []
        for column in schema:
            if schema.names.count(column.name) > 1:
                refused.append(Refused(column.name, "occurs twice in the file"))
            elif not _is_numeric(column.type):
                refused.append(Refused(column.name, f"is of type {column.type}, not numbers"))
            elif n_rows < 2:
                refused.append(Refused(column.name, "holds a single number" if n_rows else "is empty"))
            else:
                unit = "s" if _is_time(column.type) else _unit(column.metadata)
                own = origin if _is_date(column.type) else None
                stored = stored_by(_texts(column.metadata))
                load = _load(file, column.name, own)
                channels.append(Channel(column.name, n_rows, load, unit, stored=stored, origin=own))
        yield ChannelFile(tuple(channels), tuple(refused))


def _origin(file: Any, dated: list[str]) -> np.datetime64 | None:
    """Return the earliest of the first dates of the columns."""
    if not dated:
        return None
    (first,) = [next(file.iter_batches(batch_size=1, columns=dated))]
    return earliest(np.datetime64(first.column(name).to_numpy(zero_copy_only=False)[0]) for name in dated)


def _load(file: Any, name: str, origin: np.datetime64 | None) -> Load:
    def samples() -> NDArray[Any]:
        column = file.read(columns=[name]).column(name)
        if _is_time(column.type):
            return seconds_since(column.to_numpy(), origin)
        # Missing cells of whole numbers become NaN, and are told as such.
        return np.asarray(column.to_numpy())

    return samples


def _is_numeric(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_integer(kind) or types.is_floating(kind)) or _is_time(kind)


def _is_date(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_timestamp(kind))


def _is_time(kind: Any) -> bool:
    from pyarrow import types

    return bool(types.is_timestamp(kind) or types.is_duration(kind))


def _texts(metadata: Any) -> dict[str, Any]:
    return {name.decode("utf-8", errors="replace"): value for name, value in (metadata or {}).items()}


def _unit(metadata: Any) -> str | None:
    for key in UNIT_KEYS:
        if metadata and (unit := stated_unit(metadata.get(key))) is not None:
            return unit
    return None
