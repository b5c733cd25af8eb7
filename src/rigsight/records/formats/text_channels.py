"""A delimited text: how it is laid out, and its columns as channels, read strictly for a record, or as they are for a look."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from rigsight.errors import InputError
from rigsight.records.clocks import is_time
from rigsight.records.formats.channel import (
    MOST_SAMPLES,
    Channel,
    ChannelFile,
    Refused,
    check_count,
    distinct_names,
    printable,
    stated_unit,
    with_distinct_names,
)
from rigsight.records.formats.known import LARGEST_FILE, check_largest
from rigsight.records.formats.table_head import (
    COMMENT_SIGNS,
    LAST_LINES,
    MOST_HEAD,
    Dialect,
    HeadedText,
    looks_like_names,
    sniff,
    without_comment,
)
from rigsight.records.record import Floats

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
    head = HeadedText(path.name, dialect, [*examined, *last], wanted, lambda i: kept[i]).head(header)
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
    above = lines[first_row - 2].strip() if first_row > 1 else ""
    if not above.startswith(comment or COMMENT_SIGNS):
        return None
    names = [
        printable(name)
        for name in dialect.cells(above.removeprefix(comment) if comment else above.lstrip("#%/"))
    ]
    names = [name for name in names if name] if dialect.separator == " " else names
    return tuple(names) if len(names) == width and looks_like_names(dialect, names) else None


class TextColumns:
    """A delimited text with its layout; what of it is not given is found out."""

    def __init__(
        self,
        path: Path,
        wanted: Collection[str] = (),
        separator: str | None = None,
        decimal: str | None = None,
        header: bool | int | None = None,
        comment: str | None = None,
    ) -> None:
        if separator is not None and (len(separator) != 1 or separator in '"\r\n'):
            raise InputError(
                f"{path.name}: separator is {separator!r}; give one character that is neither a quote nor a line end."
            )
        if separator is not None and separator == decimal:
            raise InputError(
                f"{path.name}: separator and decimal sign are both '{decimal}'; name two different ones."
            )
        lines = read_text(path).split("\n")
        signs = comment or COMMENT_SIGNS
        kept = [i for i, line in enumerate(map(str.strip, lines), 1) if line and not line.startswith(signs)]
        if not kept:
            raise InputError(
                f"{path.name} is empty (nothing but blank or comment lines): a header and rows of numbers are needed."
            )
        self._path = path
        self._layout = find_layout(path, lines, kept, separator, decimal, header, comment, wanted)
        self._rows = kept[self._layout.n_above :]
        self._last = kept[-1]
        self._texts = [lines[number - 1] for number in self._rows]
        self._read: dict[int, Floats] = {}

    def strict(self) -> ChannelFile:
        """Return the columns for reading: all may hold anything but those that are read."""
        layout = self._layout
        pairs = zip(distinct_names(layout.names), layout.names, strict=True)
        channels = tuple(
            Channel(name, len(self._rows), partial(self._read.__getitem__, i), layout.unit(i), label=label)
            for i, (name, label) in enumerate(pairs)
        )
        lines = np.array(self._rows, dtype=np.int64)
        return ChannelFile(channels, (), "delimited text", lines, layout.notes, layout.has_names, self._ahead)

    def tolerant(self) -> ChannelFile:
        """Return the columns for a look: a cell that is no number becomes NaN, so that it can be counted."""
        self._check_rows()
        path, layout, n_rows = self._path, self._layout, len(self._rows)
        if n_rows * len(layout.names) > sum(map(len, self._texts)) + n_rows:
            raise InputError(
                f"{path.name}: most of its {n_rows} rows are shorter than the {len(layout.names)} columns of its header. "
                "Correct the file, or cut the record there."
            )
        channels: list[Channel] = []
        labels: list[str] = []
        refused: list[Refused] = []
        for i, (name, column) in enumerate(zip(layout.names, self._all().T, strict=True)):
            if np.isnan(column).all():
                refused.append(Refused(name, "holds text"))
                continue
            if np.isfinite(column).any():
                self._refuse_thousands(i, column)
            # Columns without a name of their own are called by their number, also in a campaign; times belong to their signals.
            own = bool(name) and (layout.names.count(name) == 1 or is_time(name))
            load = partial(np.asarray, column)
            channels.append(Channel(name if own else str(i + 1), n_rows, load, layout.unit(i)))
            labels.append(str(i + 1) if layout.names.count(name) > 1 else "")
        named = zip(with_distinct_names(channels), labels, strict=True)
        distinct = tuple(replace(one, label=label or one.label) for one, label in named)
        return ChannelFile(distinct, tuple(refused), "delimited text")

    def _all(self) -> Floats:
        """Return all columns, shape (n_rows, n_columns)."""
        dialect, width = self._layout.dialect, len(self._layout.names)
        try:
            table = self._table(self._texts)
            if table.shape[1] == width:
                return table
        except ValueError:
            pass
        table = np.full((len(self._rows), width), np.nan)
        for i, row in enumerate(self._texts):
            for j, cell in enumerate(dialect.cells(row)[:width]):
                number = dialect.number(cell)
                table[i, j] = np.nan if number is None else number
        return table

    def _table(
        self, texts: Sequence[str], columns: list[int] | None = None, *, blank: bool = False
    ) -> Floats:
        """Return some columns or all, shape (n_rows, n_columns); a blank cell is NaN if there may be some."""
        dialect = self._layout.dialect
        return np.loadtxt(
            [text.replace(",", ".") for text in texts] if dialect.decimal == "," else texts,
            delimiter=None if dialect.separator == " " else dialect.separator,
            usecols=columns,
            quotechar='"',
            comments=None,
            converters=(lambda cell: float(cell) if cell.strip() else np.nan) if blank else None,
            ndmin=2,
        )

    def _ahead(self, needed: Mapping[str, int], blank: bool) -> None:
        """Read the columns that are needed at once; a cell may be blank if that is said."""
        self._check_rows()
        if not needed:
            return
        self._check_widths()
        if self._layout.dialect.decimal == "," and any("." in text for text in self._texts):
            self._report_culprit(needed)
        try:
            table = self._table(self._texts, list(needed.values()), blank=blank)
        except ValueError:
            self._report_culprit(needed, blank=blank)
            raise InputError(
                f"{self._path.name} cannot be read as numbers; specify separator and decimal sign."
            ) from None
        for i, column in zip(needed.values(), table.T, strict=True):
            self._refuse_thousands(i, column)
            self._read[i] = np.ascontiguousarray(column)

    def _refuse_thousands(self, position: int, numbers: Floats) -> None:
        """Refuse a column of numbers, shape (n_rows,), whose decimal sign separates thousands: ``39,998`` beside ``998``."""
        # Decimals are written with as many places in all cells, or without zeros at their end, so that some have less than three.
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
        sign = self._layout.dialect.decimal
        grouped, plain = [], False
        of_rows = (
            (number, self._layout.dialect.cells(text))
            for number, text in zip(self._rows, self._texts, strict=True)
        )
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
                f"{self._path.name}, line {number}, column '{self._layout.names[position]}': '{cell}' has a '{sign}' between "
                f"thousands: in all {len(grouped)} numbers with a '{sign}' three digits follow, and others have none. Export the "
                "column without signs between thousands."
            )

    def _check_rows(self) -> None:
        if not self._rows:
            raise InputError(
                f"{self._path.name} has a header but no rows of numbers below line {self._last}."
            )

    def _check_widths(self) -> None:
        """Refuse rows of another width: a cut last line, or a decimal comma between commas."""
        dialect, width = self._layout.dialect, len(self._layout.names)
        sign, n_signs, texts = dialect.separator, width - 1, enumerate(self._texts)
        # Separators within quotes are none.
        if sign == " ":
            odd = [i for i, text in texts if len(text.split()) != width]
        else:
            odd = [i for i, text in texts if text.count(sign) != n_signs]
        for text, number in ((self._texts[i], self._rows[i]) for i in odd):
            if (n_cells := len(dialect.cells(text))) != width:
                remedy = (
                    "The file ends there: delete the incomplete line."
                    if number == self._rows[-1]
                    else "Correct the line, or specify separator and decimal sign."
                )
                raise InputError(
                    f"{self._path.name}, line {number}: {n_cells} columns, but {width} above it. {remedy}"
                )

    def _report_culprit(self, needed: Mapping[str, int], *, blank: bool = False) -> None:
        """Raise for the first cell that is not a number; slow, so only after the fast reading failed."""
        dialect, names = self._layout.dialect, self._layout.names
        for text, number in zip(self._texts, self._rows, strict=True):
            cells = dialect.cells(text)
            for signal, position in needed.items():
                cell = cells[position]
                if dialect.number(cell) is not None or (blank and not cell.strip()):
                    continue
                other = Dialect(dialect.separator, "," if dialect.decimal == "." else ".")
                if not cell:
                    what = "the cell is empty. Cut the record there or fill the gap before reading."
                elif other.number(cell) is not None:
                    what = f"'{cell}' has a decimal sign other than '{dialect.decimal}'. "
                    what += f'Specify it: decimal = "{other.decimal}".'
                else:
                    what = f"'{cell}' is not a number. Correct the cell."
                    if signal.startswith("time "):
                        what += " Time is a number, not a date."
                raise InputError(f"{self._path.name}, line {number}, column '{names[position]}': {what}")
