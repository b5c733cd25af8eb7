"""A rig file (TOML) -> the declaration of a rig. Nothing of it is executed; whatever is wrong is one message with its place."""

from __future__ import annotations

import json
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import Any

from rigsight.errors import InputError
from rigsight.records.formats.known import file_size
from rigsight.rigs.parts import READING
from rigsight.rigs.reading.declaration import Declaration
from rigsight.rigs.reading.declared_names import check_all_used, check_declared_names, check_names_read
from rigsight.rigs.reading.declared_rig import rig_of
from rigsight.rigs.reading.declared_units import check_units_add_up
from rigsight.rigs.reading.simulator import check_simulator, with_whole_path
from rigsight.rigs.reading.sound_mechanism import check_mechanism
from rigsight.rigs.reading.toml_places import Path as KeyPath
from rigsight.rigs.reading.toml_places import Place, toml_tables, value_places
from rigsight.rigs.rig import Rig

LARGEST_FILE = 1_000_000


def read_rig_file(path: Path) -> Rig:
    """Return the rig that a file declares.

    Raises
    ------
    InputError
        Naming the file, line and column, what was wrong and what to write instead.
    """
    if file_size(path, "the rig file") > LARGEST_FILE:
        raise InputError(f"{path}: a rig file may have at most {LARGEST_FILE / 1e6:g} MB.")
    try:
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not text in UTF-8 (byte {error.start}).") from None
    return rig_of_text(text, str(path), folder=path.parent)


def rig_of_text(
    text: str, source: str = "rig file", *, check_units: bool = True, folder: Path | None = None
) -> Rig:
    """Return the rig that a text declares."""
    content = toml_tables(text, source)
    if folder is not None:
        content = with_whole_path(content, folder)
    return _rig_of(content, value_places(text), source, check_units)


def rig_of_tables(tables: Mapping[str, Any], source: str) -> Rig:
    """Return the rig that the tables of a file declare.

    Parameters
    ----------
    tables
        As `tomllib` returns them.
    source
        How messages call it.

    Raises
    ------
    InputError
        Naming the table and key of what was wrong, and what to write instead.
    """
    return _rig_of(tables, {}, source, check_units=True)


_read: dict[str, Rig] = {}
"""Rigs by their declaration: the same one is the same object, whichever file holds it, so that its equations are made once."""
_with_checked_units: set[str] = set()
"""Declarations whose units are known to add up."""


def _rig_of(
    tables: Mapping[str, Any], places: Mapping[KeyPath, Place], source: str, check_units: bool
) -> Rig:
    try:
        key = json.dumps(tables)
    except (TypeError, ValueError, RecursionError):
        # Dates, or what is no table at all: the reader says so.
        key = ""
    if key in _read and (key in _with_checked_units or not check_units):
        return _read[key]
    rig = _checked(Declaration(dict(tables), places, source), check_units)
    if not key:
        return rig
    if check_units:
        _with_checked_units.add(key)
    return _read.setdefault(key, rig)


def _checked(declaration: Declaration, check_units: bool) -> Rig:
    check_declared_names(declaration)
    check_simulator(declaration)
    check_names_read(declaration)
    order = signal_order(declaration)
    if check_units:
        check_units_add_up(declaration, order)
    check_all_used(declaration)
    rig = rig_of(declaration, order)
    check_mechanism(declaration, rig.mechanism)
    return rig


def signal_order(declaration: Declaration) -> list[KeyPath]:
    """Return the paths of signals, drives and sensors so that each reads only those in front of it."""
    table = declaration.table
    own: dict[str, KeyPath] = {
        **{name: ("signals", name) for name in table.signals},
        **{name: ("drives", name, "signal") for name in table.drives},
        **{f"{READING}{name}": ("sensors", name, "reads") for name in table.sensors},
    }
    graph: dict[str, set[str]] = {}
    for node, path in own.items():
        read = {
            f"{READING}{name}" if declaration.reads_sensor(path, name) else name
            for name in declaration.expressions[path].reads
        }
        graph[node] = {name for name in read if name in own}
    try:
        return [own[node] for node in TopologicalSorter(graph).static_order()]
    except CycleError as error:
        loop = [name.removeprefix(READING) for name in reversed(error.args[1])]
        declaration.refuse(
            own[error.args[1][0]],
            f"an algebraic loop (no state in it): {' -> '.join(loop)}; each needs the value of the next",
        )
