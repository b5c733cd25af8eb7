"""How is a text file delimited, and where are names, units and numbers among other lines above them?

Loggers write information about the test above the table: its number, the date, the operator, in any number of cells. The rows of
numbers are found first: the last lines of a file belong to them, and the lines directly above the first one are units or names.
"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate

from rigsight.errors import InputError
from rigsight.records.channel_names import closeness
from rigsight.records.channel_units import is_unit

COMMENT_SIGNS = ("#", "%", "//")
# Earlier wins a tie: a comma may also be a decimal sign, and white space surrounds other separators.
SEPARATORS = (";", "\t", "|", ",", " ")
LINES_LOOKED_AT = 60
"""At the beginning of a text, where its names stand, and as many at its end, where numbers do."""
SIGNS_LOOKED_AT = 400_000

LAST_LINES = 60
"""Lines at the end from which the shape of a row is read: more of them are rows of numbers than anything else."""
MOST_HEAD = 1000
"""Lines among which the first row of numbers is looked for."""
_NAMES_BELOW = 20
"""Lines in which no names follow upon a row of numbers: what a logger counts above the table is no row of it."""
_CLEAR = 2.0
"""Closeness from which a cell names time."""
_TIME = "t"
_REMARKS = "Comment"


@dataclass(frozen=True)
class Dialect:
    """How cells and numbers are written."""

    separator: str  # between cells; a blank stands for any run of white space
    decimal: str  # ``"."`` or ``","``

    def cells(self, line: str) -> list[str]:
        """Return the cells of a line, without quotes and surrounding blanks."""
        if self.separator == " ":
            parts = line.split() if '"' not in line else _quoted(" ".join(line.split()), " ")
        elif '"' in line:
            parts = _quoted(line, self.separator)
        else:
            parts = line.split(self.separator)
        return [part.strip().strip("\"'").strip() for part in parts]

    def number(self, cell: str) -> float | None:
        """Return the number a cell holds (NaN and Inf included), or None."""
        if self.decimal == ",":
            if "." in cell:
                return None
            cell = cell.replace(",", ".")
        try:
            return None if "_" in cell else float(cell)
        except ValueError:
            return None

    def is_text(self, cell: str) -> bool:
        """Return True if a cell is no number, nor one with the other decimal sign."""
        return all(Dialect(self.separator, sign).number(cell) is None for sign in (".", ","))


def _quoted(line: str, separator: str) -> list[str]:
    """Return the cells of a line with quotes; where these make no sense, as if they were none."""
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=separator != " "))
    except csv.Error:
        return line.split(separator)


def sniff(lines: Sequence[str], separator: str | None, decimal: str | None) -> Dialect:
    """Return the dialect in which most cells of equally wide rows are numbers."""
    sample = _whole_up_to(lines[:LINES_LOOKED_AT])
    last = _whole_up_to(lines[: -LINES_LOOKED_AT - 1 : -1])[::-1] if len(lines) > LINES_LOOKED_AT else sample
    candidates = [
        Dialect(candidate, sign)
        for candidate in (SEPARATORS if separator is None else (separator,))
        for sign in ((".", ",") if decimal is None else (decimal,))
        if candidate != sign
    ]
    return max(
        candidates, key=lambda dialect: _plausibility(dialect, sample, last, alone=separator is not None)
    )


def _whole_up_to(lines: Sequence[str]) -> Sequence[str]:
    """Return the first lines, two at least, that are not too long together."""
    signs = accumulate(map(len, lines))
    return lines[: max(sum(count <= SIGNS_LOOKED_AT for count in signs), 2)]


def _plausibility(
    dialect: Dialect, first: Sequence[str], last: Sequence[str], alone: bool
) -> tuple[bool, float, bool]:
    """Return what makes a dialect plausible, most telling first; tuples compare in that order."""
    # A line above the numbers as wide as the rows, then the share of cells that are numbers, then that there are columns at all.
    rows = [dialect.cells(line) for line in last]
    width = Counter(len(row) for row in rows).most_common(1)[0][0]
    if width < 2 and not alone:
        return False, 0.0, False
    numbers = sum(dialect.number(cell) is not None for row in rows if len(row) == width for cell in row)
    return _begins_in_columns(dialect, first, width), numbers / sum(len(row) for row in rows), True


def _begins_in_columns(dialect: Dialect, lines: Sequence[str], width: int) -> bool:
    """Return True if the first row of numbers, or else the first line, has a line of the same width above it, or nothing."""
    above = None
    for line in lines:
        cells = dialect.cells(line)
        if len(cells) == width and 2 * sum(not dialect.is_text(cell) for cell in cells) > width:
            return above is None or above == width
        above = len(cells)
    return len(dialect.cells(lines[0])) == width


def looks_like_names(dialect: Dialect, cells: Sequence[str]) -> bool:
    """Return True for a header or units row: mostly text, so that one broken number is not taken for a header."""
    filled = [cell for cell in cells if cell]
    return sum(dialect.is_text(cell) for cell in filled) * 2 > len(filled)


@dataclass(frozen=True)
class Head:
    """What stands above the rows of numbers; lines are counted from 0."""

    # Lines of the names and of the units, None where there are none.
    names: int | None
    units: int | None
    first_row: int  # first line of the rows of numbers

    @property
    def n_passed(self) -> int:
        """Number of lines above that are neither names nor units."""
        return self.first_row - (self.names is not None) - (self.units is not None)


@dataclass(frozen=True)
class HeadedText:
    """The lines of a text, among which names and rows of numbers are looked for."""

    file: str  # name, for messages
    dialect: Dialect  # how cells and numbers are written
    lines: Sequence[str]  # the first ones and the last
    wanted: Collection[str]  # names that are asked for
    number_of: Callable[[int], int]  # number of a line in the file

    @cached_property
    def _shape(self) -> tuple[int, list[int]]:
        """The number of cells of a row of numbers, and the columns that hold numbers, as the last lines have them."""
        rows = [self.dialect.cells(line) for line in self.lines[-LAST_LINES:]]
        width, is_text = Counter(len(row) for row in rows).most_common(1)[0][0], self.dialect.is_text
        rows = [row for row in rows if len(row) == width]
        return width, [j for j in range(width) if 2 * sum(not is_text(row[j]) for row in rows) > len(rows)]

    def _cells(self, line: int) -> list[str]:
        return self.dialect.cells(self.lines[line])

    def _is_row(self, cells: Sequence[str]) -> bool:
        """Return True for a sound row of numbers."""
        width, numeric = self._shape
        return len(cells) == width and not any(self.dialect.is_text(cells[j]) for j in numeric)

    def _is_broken_row(self, cells: Sequence[str]) -> bool:
        """Return True for a row that has lost a cell or a number and is one all the same."""
        filled = [cell for cell in cells if cell]
        return 2 * sum(not self.dialect.is_text(cell) for cell in filled) > len(filled)

    def _is_words(self, cells: Sequence[str]) -> bool:
        """Return True for a row of words under which numbers may stand."""
        return len(cells) == self._shape[0] and any(cells) and looks_like_names(self.dialect, cells)

    def _first_rows(self) -> list[int]:
        """Return where rows of numbers begin: once in a sound text, again below words among them; empty where there are none."""
        found: list[int] = []
        in_rows = False
        for i, line in enumerate(self.lines[:MOST_HEAD]):
            cells = self.dialect.cells(line)
            if self._is_row(cells):
                if not in_rows:
                    found.append(i)
                in_rows = True
                if i - found[-1] >= _NAMES_BELOW:
                    break
            elif self._is_words(cells):
                in_rows = False
        return [self._with_broken_rows(i) for i in found] if self._shape[1] else []

    def _with_broken_rows(self, first: int) -> int:
        while first > 0 and self._is_broken_row(self._cells(first - 1)):
            first -= 1
        return first

    def head(self, header: bool | int | None) -> Head:
        """Return what stands above the rows of numbers; `header` says whether, or in which line, the names do."""
        if isinstance(header, int) and not isinstance(header, bool):
            numbers = [self.number_of(i) for i in range(min(len(self.lines), MOST_HEAD))]
            if header not in numbers:
                raise self._unclear(f"header = {header}: that line is blank, a comment, or not there.")
            return self._below(numbers.index(header))
        rows = self._first_rows()
        if not rows:
            # Nothing below is a row of numbers; what is wrong there is told once the names are known.
            named = looks_like_names(self.dialect, self._cells(0)) if header is None else header
            return self._below(0) if named else Head(None, None, 0)
        first = rows[0] if len(rows) == 1 else self._first_of(rows)
        if header is False:
            return Head(None, None, first)
        block = self._words_above(first)
        if not block:
            return self._without_words(first, header)
        names = self._names_in(block)
        if first - names > 2:
            at, last = self.number_of(names), self.number_of(first - 1)
            raise self._unclear(
                f"lines {at} to {last} are all above the first row of numbers; only one line may contain names and the next one "
                f"units. If the names are in line {at}, delete the lines between units and numbers, else write header = LINE."
            )
        return Head(names, names + 1 if names + 1 < first else None, first)

    def _unclear(self, why: str) -> InputError:
        return InputError(f"{self.file}: {why}")

    def _below(self, names: int) -> Head:
        """Return the head whose names are known; a line of nothing but text below them holds units."""
        units = names + 1
        if units < len(self.lines):
            cells = self._cells(units)
            if any(cells) and all(self.dialect.is_text(cell) for cell in cells):
                return Head(names, units, units + 1)
        return Head(names, None, units)

    def _without_words(self, first: int, header: bool | None) -> Head:
        """Return the head of numbers above which no names stand."""
        if header:
            return self._below(max(first - 1, 0))
        if first == 0 or self.number_of(first) > self.number_of(first - 1) + 1:
            return Head(None, None, first)
        above, width = self._cells(first - 1), len(self._cells(first))
        if len(without_comment(above, width)) == width and looks_like_names(self.dialect, above):
            # They fit the first rows; that others have another width is told by the line where that begins.
            return Head(first - 1, None, first)
        count = len(above)
        raise self._unclear(
            f"line {self.number_of(first - 1)} has {count} column{'s' if count > 1 else ''}, the rows of numbers below it have "
            f"{self._shape[0]}, so it cannot contain their names. Give each column a name there, or write header = false to "
            "count the columns."
        )

    def _words_above(self, first: int) -> range:
        """Return the lines of words right above a row."""
        block = first
        while block > 0 and self._is_words(self._cells(block - 1)):
            block -= 1
        return range(block, first)

    def _first_of(self, rows: Sequence[int]) -> int:
        """Return where the rows begin that have the names above them which are asked for, or a time."""
        words = {i: [self._cells(j) for j in self._words_above(i)] for i in rows}
        held = [i for i in rows if any(set(cells) & set(self.wanted) for cells in words[i])]
        timed = [i for i in rows if any(_names_time(cell) for cells in words[i] for cell in cells)]
        for found in (held, timed):
            if len(found) == 1:
                return found[0]
        places = " and ".join(str(self.number_of(i)) for i in rows[:3])
        raise self._unclear(
            f"rows of numbers begin in lines {places}, with text between them. Cut the record where the logger restarted; if the "
            f"text above is not part of the table, write header = LINE with the line of the names."
        )

    def _names_in(self, block: range) -> int:
        """Return which of several lines of words contains the names: by requested names, a time, or units below it."""
        rows = {i: self._cells(i) for i in block}
        held = {i: len(set(cells) & set(self.wanted)) for i, cells in rows.items()}
        most = [i for i in block if held[i] == max(held.values())]
        if max(held.values()) > 0 and len(most) == 1:
            return most[0]
        timed = [i for i in block if any(map(_names_time, rows[i]))]
        if len(timed) == 1:
            return timed[0]
        last = block[-1]
        return last - 1 if len(block) > 1 and _are_units(rows[last]) else last


def without_comment(names: Sequence[str], width: int) -> Sequence[str]:
    """Return the names of columns without one for remarks at their end: LabVIEW writes no cell of it where there is no remark."""
    return names[:-1] if len(names) == width + 1 and names[-1] == _REMARKS else names


def _names_time(cell: str) -> bool:
    return closeness(cell, _TIME) >= _CLEAR


def _are_units(cells: Sequence[str]) -> bool:
    bare = [cell.strip("[]() ") for cell in cells if cell not in ("", "-", "1")]
    return 2 * sum(is_unit(cell) for cell in bare) >= len(bare)
