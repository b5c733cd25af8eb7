"""Which channels does a Parquet file hold, also one of a LeRobot data set?

References
----------
R. Cadene et al., *LeRobot: State-of-the-art machine learning for real-world robotics* (2024), data sets of version 2 and 3: a
column of lists is a feature such as ``observation.state``, and ``meta/info.json`` above the file names its numbers.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.records.formats.channel import (
    MOST_COLUMNS,
    Channel,
    ChannelFile,
    Refused,
    as_stamps,
    check_count,
    listed,
    stored_by,
    too_short,
    unit_of,
)
from rigsight.records.stamps import earliest, seconds_since

_STAMPS, _EPISODE = "timestamp", "episode_index"
_PAUSE = 10.0
"""Between the episodes of one file [s]: each is a record of its own."""
_DEEPEST = 4
"""Folders above a file in which the description of its data set is looked for: data/chunk-000/file.parquet."""


def open_parquet(path: Path) -> Iterator[ChannelFile]:
    """Yield the columns of numbers of a Parquet file; units from the metadata ``unit`` of a column."""
    # Time is a column like any other; dates and durations count in seconds from the first.
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        check_count(path.name, len(file.schema_arrow))
        yield listed(path.name, _parts(file, _names_of_features(path)))


def _parts(file: Any, features: Mapping[str, Sequence[str]]) -> Iterator[Channel | Refused]:
    from pyarrow import types

    schema, n_rows = file.schema_arrow, file.metadata.num_rows
    dated = [column.name for column in schema if types.is_timestamp(column.type)]
    origin = _origin(file, dated) if n_rows and len(set(schema.names)) == len(schema.names) else None
    for column in schema:
        name, kind = column.name, column.type
        is_time = types.is_timestamp(kind) or types.is_duration(kind)
        if schema.names.count(name) > 1:
            yield Refused(name, "occurs twice in the file")
        elif _is_list(kind) and n_rows > 1:
            yield from _of_lists(file, name, n_rows, features.get(name, ()))
        elif not (types.is_integer(kind) or types.is_floating(kind) or is_time):
            yield Refused(name, f"is of type {kind}, not numbers")
        elif reason := too_short(n_rows):
            yield Refused(name, reason)
        else:
            stated = (column.metadata or {}).items()
            said = {key.decode("utf-8", errors="replace"): value for key, value in stated}
            own = origin if types.is_timestamp(kind) else None
            unit, load = (
                "s" if is_time else unit_of(said),
                partial(_samples, file, name, own, is_time=is_time),
            )
            if name == _STAMPS and _EPISODE in schema.names and types.is_floating(kind):
                load = partial(_one_after_another, file)
            yield Channel(name, n_rows, load, unit, stored=stored_by(said), origin=own)


def _is_list(kind: Any) -> bool:
    from pyarrow import types

    is_list = types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind)
    return bool(is_list and (types.is_integer(kind.value_type) or types.is_floating(kind.value_type)))


def _of_lists(file: Any, name: str, n_rows: int, labels: Sequence[str]) -> Iterator[Channel | Refused]:
    """Yield the channels of a column of lists, one for each number in a list."""
    (first,) = [next(file.iter_batches(batch_size=1, columns=[name]))]
    n_numbers = len(first.column(0)[0].as_py() or ())
    if not 0 < n_numbers <= MOST_COLUMNS:
        yield Refused(name, f"holds lists of {n_numbers} numbers, not signals side by side")
        return

    def samples(index: int) -> NDArray[Any]:
        from pyarrow import compute

        column = file.read(columns=[name]).column(name)
        if set(compute.unique(compute.list_value_length(column)).to_pylist()) != {n_numbers}:
            raise ValueError(f"the lists of '{name}' differ in length")
        return np.asarray(compute.list_element(column, index).to_numpy())

    own = labels if len(labels) == n_numbers else [str(index) for index in range(n_numbers)]
    for index, label in enumerate(own):
        yield Channel(f"{name}/{label}", n_rows, partial(samples, index))


def _names_of_features(path: Path) -> dict[str, list[str]]:
    """Return the names of the numbers of each feature, from the description of a data set above a file; empty without one."""
    for folder in path.resolve().parents[:_DEEPEST]:
        try:
            described = json.loads((folder / "meta" / "info.json").read_text(encoding="utf-8"))
            features = described["features"].items()
        except (OSError, ValueError, KeyError, AttributeError, TypeError):
            continue
        # Older data sets have the names by kind: {"motors": ["shoulder", ...]}.
        found = {}
        for name, own in features:
            named = own.get("names") if isinstance(own, dict) else None
            labels = next(iter(named.values()), None) if isinstance(named, dict) else named
            if isinstance(labels, list):
                found[name] = [str(label) for label in labels]
        return found
    return {}


def _origin(file: Any, dated: list[str]) -> np.datetime64 | None:
    """Return the earliest of the first dates of the columns."""
    if not dated:
        return None
    (first,) = [next(file.iter_batches(batch_size=1, columns=dated))]
    return earliest(np.datetime64(first.column(name).to_numpy(zero_copy_only=False)[0]) for name in dated)


def _one_after_another(file: Any) -> NDArray[Any]:
    """Return the time of episodes in one file, shape (n_samples,): each begins a pause after the one before."""
    table = file.read(columns=[_STAMPS, _EPISODE])
    stamps, episode = (np.asarray(table.column(name).to_numpy()) for name in (_STAMPS, _EPISODE))
    # In single precision a time behind many episodes loses its digits.
    stamps = as_stamps(stamps)
    for begin in np.flatnonzero(np.diff(episode)) + 1:
        stamps[begin:] += stamps[begin - 1] + _PAUSE - stamps[begin]
    return stamps


def _samples(file: Any, name: str, origin: np.datetime64 | None, *, is_time: bool) -> NDArray[Any]:
    # Missing cells of whole numbers become NaN, and are told as such.
    column = file.read(columns=[name]).column(name).to_numpy()
    return seconds_since(column, origin) if is_time else np.asarray(column)
