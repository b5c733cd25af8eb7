"""How is a delimited text read and laid out: its signs, the names and units of its columns, the first row of numbers?"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.formats.channel import MOST_SAMPLES, check_count, printable, stated_unit
from rigsight.records.formats.known import LARGEST_FILE, check_largest
from rigsight.records.formats.table_head import (
    LAST_LINES,
    MOST_HEAD,
    Dialect,
    UnclearHeadError,
    find_head,
    is_comment,
    looks_like_names,
    sniff,
    without_comment,
)

_PIECE = 1 << 20
_LONGEST_LINE = 1_000_000
_MOST_LINES = MOST_SAMPLES + 1000

_FEWEST_GROUPED = 10
"""Numbers with three digits behind their sign: one in ten decimals without zeros at the end has less, so that in ten numbers one
shows with a probability of 0.65, in the hundreds of a record for certain."""


def read_text(path: Path) -> str:
    """Return the text of a file with line feeds only."""
    check_largest(path, LARGEST_FILE)
    try:
        _check_text(path)
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}.") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = data.decode("utf-16", errors="replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _check_text(path: Path) -> None:
    """Refuse what is no text, or no table, piece by piece: all of it in memory takes several times the file."""
    n_lines, unbroken = 0, 0
    with path.open("rb") as file:
        head = file.read(4)
        wide = head.startswith((b"\xff\xfe", b"\xfe\xff"))
        file.seek(0)
        while piece := file.read(_PIECE):
            if (b"\x00" in piece and not wide) or head == b"PK\x03\x04":
                raise InputError(f"{path.name} is not a text file; export the record as CSV.")
            last = max(piece.rfind(b"\n"), piece.rfind(b"\r"))
            unbroken = len(piece) - last - 1 if last >= 0 else unbroken + len(piece)
            n_lines += max(piece.count(b"\n"), piece.count(b"\r"))
            if unbroken > _LONGEST_LINE:
                raise InputError(
                    f"{path.name} has a line of more than {_LONGEST_LINE / 1e6:g} MB, the longest that is read; a record is a "
                    "table with one row per sample."
                )
            if n_lines > _MOST_LINES:
                raise InputError(
                    f"{path.name} has more than {_MOST_LINES} lines, the most that are read; split it into several records or "
                    "reduce the sample rate."
                )


@dataclass(frozen=True)
class Layout:
    """How the columns of a text file are laid out."""

    dialect: Dialect  # how cells and numbers are written
    names: tuple[str, ...]  # of the columns; their numbers where the file has no header
    n_above: int  # how many of the kept lines stand above the first row of numbers
    has_names: bool  # whether the file has a header
    notes: tuple[str, ...]  # what was assumed
    units: tuple[str, ...] = ()  # cells of a units row, empty where there is none

    def unit(self, position: int) -> str | None:
        """Return the unit that the row of units states for a column, None if it states none."""
        return stated_unit(self.units[position]) if position < len(self.units) else None

    def refuse_thousands(
        self,
        path: Path,
        position: int,
        texts: Sequence[str],
        rows: Sequence[int],
        numbers: NDArray[np.float64],
    ) -> None:
        """Refuse a column of numbers, shape (n_rows,), whose decimal sign separates thousands: ``39,998`` beside ``998``.

        Decimals are written with as many places in all cells, or without zeros at their end, so that some have less than three.
        """
        finite = numbers[np.isfinite(numbers)]
        whole = finite == np.round(finite)
        # Cheap questions first: of three decimals at most, and numbers with and without.
        if whole.all() or not whole.any() or np.max(np.abs(finite)) >= 1000.0:
            return
        if (
            np.min(np.abs(finite[~whole])) < 1.0
            or np.max(np.abs(1e3 * finite - np.round(1e3 * finite))) > 1e-6
        ):
            return
        sign = self.dialect.decimal
        grouped, plain = [], False
        of_rows = ((number, self.dialect.cells(text)) for number, text in zip(rows, texts, strict=True))
        # Rows may be shorter than the header: what they lack is missing, not a number.
        for number, cell in ((number, row[position]) for number, row in of_rows if position < len(row)):
            if sign not in cell:
                plain = True
            elif re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}{re.escape(sign)}\d{{3}}", cell):
                grouped.append((number, cell))
            else:
                return
        if plain and len(grouped) >= _FEWEST_GROUPED:
            number, cell = grouped[0]
            raise InputError(
                f"{path.name}, line {number}, column '{self.names[position]}': '{cell}' has a '{sign}' between thousands: in all "
                f"{len(grouped)} numbers with a '{sign}' three digits follow, and others have none. Export the column without "
                "signs between thousands."
            )


def kept_lines(lines: Sequence[str], comment: str | None = None) -> list[int]:
    """Return the numbers, from 1, of the lines that are neither blank nor comments."""
    return [
        number
        for number, line in enumerate(lines, 1)
        if line and not line.isspace() and not is_comment(line, comment)
    ]


def find_layout(
    path: Path,
    lines: Sequence[str],
    kept: Sequence[int],
    separator: str | None,
    decimal: str | None,
    header: bool | int | None,
    comment: str | None,
    wanted: Collection[str] = (),
) -> Layout:
    """Return the layout of a text of which the lines numbered `kept` are no comments; what is None is found out."""
    examined = [lines[number - 1] for number in kept[:MOST_HEAD]]
    last = [lines[number - 1] for number in kept[MOST_HEAD:][-LAST_LINES:]]
    dialect = sniff([*examined, *last], separator, decimal)
    try:
        head = find_head(dialect, [*examined, *last], wanted, header, lambda i: kept[i])
    except UnclearHeadError as error:
        raise InputError(f"{path.name}: {error}") from None
    first_row = kept[min(head.first_row, len(kept) - 1)]
    widest = lines[(first_row if head.names is None else kept[head.names]) - 1]
    width = len(dialect.cells(lines[first_row - 1]))
    first = [printable(cell) for cell in without_comment(dialect.cells(widest), width)]
    check_count(path.name, len(first))
    notes = []
    if head.n_passed > 0:
        notes.append(
            f"{path.name}: {head.n_passed} line{'s' if head.n_passed > 1 else ''} above the "
            f"{'numbers' if head.names is None else f'names in line {kept[head.names]}'} are not part of the table and were "
            f"skipped."
        )
    if head.names is None:
        names = _names_in_comment(lines, first_row, dialect, len(first), comment)
        numbers = tuple(str(i + 1) for i in range(len(first)))
        return Layout(dialect, names or numbers, head.first_row, bool(names), tuple(notes))
    units: tuple[str, ...] = ()
    if head.units is not None:
        units = tuple(printable(cell) for cell in dialect.cells(lines[kept[head.units] - 1]))
        notes.append(f"{path.name}, line {kept[head.units]}: taken as a row of units ({', '.join(units)}).")
    return Layout(dialect, tuple(first), head.first_row, True, tuple(notes), units)


def _names_in_comment(
    lines: Sequence[str], first_row: int, dialect: Dialect, width: int, comment: str | None
) -> tuple[str, ...] | None:
    """Return the names in a commented header right above the first row, where there is one."""
    if first_row < 2 or not is_comment(lines[first_row - 2], comment):
        return None
    above = lines[first_row - 2].strip()
    names = [
        printable(name)
        for name in dialect.cells(above.removeprefix(comment) if comment else above.lstrip("#%/"))
    ]
    names = [name for name in names if name] if dialect.separator == " " else names
    return tuple(names) if len(names) == width and looks_like_names(dialect, names) else None
