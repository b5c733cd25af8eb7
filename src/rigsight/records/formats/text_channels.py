"""The columns of a delimited text as channels: read strictly for a record, or with what is no number as NaN, to be looked at."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.records.clocks import is_time
from rigsight.records.formats.channel import (
    Channel,
    ChannelFile,
    Refused,
    distinct_names,
    with_distinct_names,
)
from rigsight.records.formats.layout import find_layout, kept_lines, read_text
from rigsight.records.formats.table_head import Dialect


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
        kept = kept_lines(lines, comment)
        if not kept:
            raise InputError(
                f"{path.name} is empty (nothing but blank or comment lines): a header and rows of numbers are needed."
            )
        self._path = path
        self._layout = find_layout(path, lines, kept, separator, decimal, header, comment, wanted)
        self._rows = kept[self._layout.n_above :]
        if not self._rows:
            raise InputError(f"{path.name} has a header but no rows of numbers below line {kept[-1]}.")
        self._texts = [lines[number - 1] for number in self._rows]
        self._read: dict[int, NDArray[np.float64]] = {}

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
        path, layout, n_rows = self._path, self._layout, len(self._rows)
        if n_rows * len(layout.names) > sum(map(len, self._texts)) + n_rows:
            raise InputError(
                f"{path.name}: most of its {n_rows} rows are shorter than the {len(layout.names)} columns of its header. "
                "Correct the file, or cut the record there."
            )
        channels: list[Channel] = []
        refused: list[Refused] = []
        for i, (name, column) in enumerate(zip(layout.names, self._all().T, strict=True)):
            if np.isnan(column).all():
                refused.append(Refused(name, "holds text"))
                continue
            if np.isfinite(column).any():
                layout.refuse_thousands(path, i, self._texts, self._rows, column)
            # Columns without a name of their own are called by their number, also in a campaign; times belong to their signals.
            own = bool(name) and (layout.names.count(name) == 1 or is_time(name))
            load = partial(np.asarray, column)
            channels.append(Channel(name if own else str(i + 1), n_rows, load, layout.unit(i)))
        return ChannelFile(with_distinct_names(channels), tuple(refused), "delimited text")

    def _all(self) -> NDArray[np.float64]:
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
    ) -> NDArray[np.float64]:
        """Return some columns or all, shape (n_rows, n_columns); a blank cell is NaN if there may be some."""
        dialect = self._layout.dialect
        return np.loadtxt(
            [text.replace(",", ".") for text in texts] if dialect.decimal == "," else texts,
            delimiter=None if dialect.separator == " " else dialect.separator,
            usecols=columns,
            quotechar='"',
            comments=None,
            converters=_number_or_blank if blank else None,
            ndmin=2,
        )

    def _ahead(self, needed: Mapping[str, int], blank: bool) -> None:
        """Read the columns that are needed at once; a cell may be blank if that is said."""
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
            self._layout.refuse_thousands(self._path, i, self._texts, self._rows, column)
            self._read[i] = np.ascontiguousarray(column)

    def _check_widths(self) -> None:
        """Refuse rows of another width: a cut last line, or a decimal comma between commas."""
        dialect, width = self._layout.dialect, len(self._layout.names)
        for text, number in zip(self._texts, self._rows, strict=True):
            n_cells = len(text.split()) if dialect.separator == " " else text.count(dialect.separator) + 1
            if n_cells != width and (n_cells := len(dialect.cells(text))) != width:
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


def _number_or_blank(cell: str) -> float:
    return float(cell) if cell.strip() else float("nan")
