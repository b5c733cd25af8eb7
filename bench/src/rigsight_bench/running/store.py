"""The outcomes of up to 100,000 trials on disk; a process that is killed at any moment loses none and duplicates none.

One row per trial in one SQLite file; a row is written in a transaction of its own. Numbers, texts and answers are columns,
lists are JSON text.
"""

from __future__ import annotations

import contextlib
import gc
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, fields
from pathlib import Path
from types import TracebackType
from typing import Any, get_type_hints

from rigsight.errors import InputError, MachineError
from rigsight_bench.scoring import Outcome, ParameterError, WithheldError

SCHEMA_VERSION = 6
_PATIENCE = 60.0
"""Time [s] to wait for another process that writes."""
_OF_THE_DISK = ("SQLITE_FULL", "SQLITE_IOERR", "SQLITE_READONLY")
_TYPES: dict[Any, str] = {
    str: "TEXT NOT NULL",
    int: "INTEGER NOT NULL",
    bool: "INTEGER NOT NULL",
    float: "REAL NOT NULL",
    float | None: "REAL",
    bool | None: "INTEGER",
    int | None: "INTEGER",
}
_FROM_TEXT: dict[str, Callable[[list[Any]], tuple[Any, ...]]] = {
    "effects": tuple,
    "places": tuple,
    "named": tuple,
    "named_places": tuple,
    "families": tuple,
    "withheld": lambda rows: tuple(WithheldError(**row) for row in rows),
    "parameters": lambda rows: tuple(ParameterError(**row) for row in rows),
}
"""Columns that hold lists as JSON, and what they become."""
_COLUMNS = [field.name for field in fields(Outcome)]
_HINTS = get_type_hints(Outcome)
_TRUTHS = [name for name in _COLUMNS if _HINTS[name] in (bool, bool | None)]
_TABLE = f"""CREATE TABLE trials (
{", ".join(f"{name} {_TYPES.get(_HINTS[name], 'TEXT NOT NULL')}" for name in _COLUMNS)},
PRIMARY KEY (design, seed, trial))"""


@contextlib.contextmanager
def collector_paused() -> Iterator[None]:
    """Pause garbage collection, which would repeatedly scan millions of new objects, while many rows are read and counted."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class TrialStore:
    """The outcomes of one bench; a context manager.

    Parameters
    ----------
    path
        The file; made with the first row.

    Raises
    ------
    InputError
        If the file holds something else, or cannot be read or written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._connection = sqlite3.connect(path, timeout=_PATIENCE, isolation_level=None)
            self._prepare()
        except sqlite3.Error as error:
            raise self._told(error) from None

    def _prepare(self) -> None:
        """Make the table in a new file, or check that an old one is what this version writes."""
        # Two processes may begin at once: both answers are read in one transaction, and the second process finds the table.
        with self._connection:
            self._connection.execute("BEGIN")
            version = self._connection.execute("PRAGMA user_version").fetchone()[0]
            empty = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0] == 0
        if empty:
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.execute(_TABLE.replace("CREATE TABLE", "CREATE TABLE IF NOT EXISTS"))
                self._connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        elif version != SCHEMA_VERSION:
            self._connection.close()
            raise InputError(
                f"{self._path} was written by another version of rigsight (format {version}, this one writes {SCHEMA_VERSION}). "
                "Remove it; 'rigsight blind --rescore' then scores the trials again from their results."
            )

    def __enter__(self) -> TrialStore:
        """Return the store."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._connection.close()

    def scored(self) -> dict[str, str]:
        """Return the fingerprint of every trial that has a row, by its name."""
        try:
            return dict(self._connection.execute("SELECT trial, fingerprint FROM trials"))
        except sqlite3.Error as error:
            raise self._told(error) from None

    def add(self, outcomes: Iterable[Outcome]) -> None:
        """Write rows in one transaction; a row of the same trial is replaced.

        Raises
        ------
        InputError
            If they cannot be written.
        """
        marks = ", ".join("?" for _ in _COLUMNS)
        try:
            with self._connection:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.executemany(
                    f"INSERT OR REPLACE INTO trials ({', '.join(_COLUMNS)}) VALUES ({marks})",
                    map(_row, outcomes),
                )
        except sqlite3.Error as error:
            raise self._told(error) from None

    def outcomes(self) -> list[Outcome]:
        """Return all outcomes in the order of their numbers or names.

        Raises
        ------
        InputError
            If the file cannot be read.
        """
        try:
            rows = self._connection.execute(
                f"SELECT {', '.join(_COLUMNS)} FROM trials ORDER BY design, seed, CAST(trial AS INTEGER), trial"
            )
            return [_outcome(row) for row in rows]
        except sqlite3.Error as error:
            raise self._told(error) from None

    def _told(self, error: sqlite3.Error) -> InputError:
        if getattr(error, "sqlite_errorname", "").startswith(_OF_THE_DISK):
            return MachineError(
                f"{self._path} cannot be written: {error}. Free disk space there; the same command continues from here."
            )
        return InputError(
            f"{self._path} cannot be used: {error}. If it is damaged, remove it; 'rigsight blind --rescore' then scores the "
            "trials again from their results."
        )


def _row(found: Outcome) -> list[Any]:
    content = asdict(found)
    return [
        json.dumps(content[name], separators=(",", ":")) if name in _FROM_TEXT else content[name]
        for name in _COLUMNS
    ]


def _outcome(row: tuple[Any, ...]) -> Outcome:
    values = dict(zip(_COLUMNS, row, strict=True))
    for name, made in _FROM_TEXT.items():
        values[name] = made(json.loads(values[name]))
    for name in _TRUTHS:
        values[name] = None if values[name] is None else bool(values[name])
    return Outcome(**values)
