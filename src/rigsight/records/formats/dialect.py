"""How is a text file delimited: separator, decimal sign, comment lines, header and units rows?"""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

COMMENT_SIGNS = ("#", "%", "//")
# Earlier wins a tie: a comma may also be a decimal sign, and white space surrounds other separators.
SEPARATORS = (";", "\t", "|", ",", " ")
LINES_LOOKED_AT = 60
"""At the beginning of a text, where its names stand, and as many at its end, where numbers do."""
SIGNS_LOOKED_AT = 400_000


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


def is_comment(line: str, comment: str | None) -> bool:
    """Return True for a comment line; `comment` is the sign in use, None for any usual one."""
    return line.lstrip().startswith(comment or COMMENT_SIGNS)


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
    """Return what makes a dialect plausible, most telling first; tuples compare in that order.

    A line above the numbers as wide as the rows, then the share of cells that are numbers, then that there are columns at all.
    """
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
