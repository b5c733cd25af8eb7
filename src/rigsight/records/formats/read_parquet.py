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
    listed,
    stored_by,
    too_short,
    unit_of,
)
from rigsight.records.stamps import earliest, seconds_since


def open_parquet(path: Path) -> Iterator[ChannelFile]:
    """Yield the columns of numbers of a Parquet file; units from the metadata ``unit`` of a column."""
    # Time is a column like any other; dates and durations count in seconds from the first.
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        check_count(path.name, len(file.schema_arrow))
        yield listed(path.name, _parts(file))


def _parts(file: Any) -> Iterator[Channel | Refused]:
    from pyarrow import types

    schema, n_rows = file.schema_arrow, file.metadata.num_rows
    dated = [column.name for column in schema if types.is_timestamp(column.type)]
    origin = _origin(file, dated) if n_rows and len(set(schema.names)) == len(schema.names) else None
    for column in schema:
        name, kind = column.name, column.type
        is_time = types.is_timestamp(kind) or types.is_duration(kind)
        if schema.names.count(name) > 1:
            yield Refused(name, "occurs twice in the file")
        elif not (types.is_integer(kind) or types.is_floating(kind) or is_time):
            yield Refused(name, f"is of type {kind}, not numbers")
        elif reason := too_short(n_rows):
            yield Refused(name, reason)
        else:
            said = {
                key.decode("utf-8", errors="replace"): value for key, value in (column.metadata or {}).items()
            }
            own = origin if types.is_timestamp(kind) else None
            unit, load = "s" if is_time else unit_of(said), _load(file, name, own, is_time=is_time)
            yield Channel(name, n_rows, load, unit, stored=stored_by(said), origin=own)


def _origin(file: Any, dated: list[str]) -> np.datetime64 | None:
    """Return the earliest of the first dates of the columns."""
    if not dated:
        return None
    (first,) = [next(file.iter_batches(batch_size=1, columns=dated))]
    return earliest(np.datetime64(first.column(name).to_numpy(zero_copy_only=False)[0]) for name in dated)


def _load(file: Any, name: str, origin: np.datetime64 | None, *, is_time: bool) -> Load:
    def samples() -> NDArray[Any]:
        # Missing cells of whole numbers become NaN, and are told as such.
        column = file.read(columns=[name]).column(name).to_numpy()
        return seconds_since(column, origin) if is_time else np.asarray(column)

    return samples
