"""How do columns of a delimited text file become numbers in SI units?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError, nearest
from rigsight.records.clocks import TIME, increases, possible_clocks
from rigsight.records.column_mapping import ColumnMapping, Columns
from rigsight.records.formats.channel import distinct_names
from rigsight.records.formats.layout import Layout, find_layout, kept_lines, read_text
from rigsight.records.formats.table_head import Dialect


def read_csv(
    path: Path,
    columns: Mapping[str, ColumnMapping],
    *,
    optional: Sequence[str] = (),
    separator: str | None = None,
    decimal: str | None = None,
    header: bool | int | None = None,
    comment: str | None = None,
) -> Columns:
    """Read the columns that `columns` asks for; others may hold anything."""
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
    wanted = {
        name for mapping in columns.values() for name in (mapping.name, mapping.time) if isinstance(name, str)
    }
    layout = find_layout(path, lines, kept, separator, decimal, header, comment, wanted)
    found = {
        signal: position
        for signal, mapping in columns.items()
        if signal != TIME
        and (position := _position(path, signal, mapping, layout, signal in optional)) is not None
    }
    clocks = _clocks(path, columns, layout, found) if TIME in columns else {}
    if not found and TIME in columns:
        found = {TIME: clocks[TIME][0]}
    rows = kept[layout.n_above :]
    if not rows:
        raise InputError(f"{path.name} has a header but no rows of numbers below line {kept[-1]}.")
    # Signals of other rates end in other rows, and blank cells fill the rest.
    several = len({one for possible in clocks.values() for one in possible}) > 1
    needed = found | {f"time {one}": one for possible in clocks.values() for one in possible}
    table = _numbers(path, lines, rows, layout, needed, blank=several) if needed else np.empty((len(rows), 0))
    for i, position in enumerate(needed.values()):
        layout.refuse_thousands(path, position, lines, rows, table[:, i])
    cells = {position: np.ascontiguousarray(table[:, i]) for i, position in enumerate(needed.values())}
    values, axes, called, distinct = {}, {}, {}, distinct_names(layout.names)
    units = {signal: layout.unit(position) for signal, position in found.items()}
    for signal, position in found.items():
        possible = clocks.get(signal, [])
        stamps = [cells[one][: _filled(cells[one], cells[position])] for one in possible]
        chosen = next((i for i, own in enumerate(stamps) if increases(own)), len(stamps) - 1)
        values[signal] = cells[position]
        if stamps:
            axes[signal], called[signal] = stamps[chosen], distinct[possible[chosen]]
            units.setdefault(TIME, layout.unit(possible[chosen]))
            values[signal] = values[signal][: stamps[chosen].size]
    shared = len(set(called.values())) == 1 and len({stamps.size for stamps in axes.values()}) == 1
    columns_read = [(layout.names[found[s]], column) for s, column in values.items()]
    for label, column in [*columns_read, *((called[s], axes[s]) for s in axes)]:
        finite = np.isfinite(column)
        if not finite.all():
            row, count = int(np.argmin(finite)), int(np.count_nonzero(~finite))
            raise InputError(
                f"{path.name}, line {rows[row]}, column '{label}': {column[row]} is not a finite "
                f"number ({count} such cell{'s' if count > 1 else ''}). Cut the record there or fill the gap before reading."
            )
    labels = {signal: layout.names[position] for signal, position in found.items()}
    if shared:
        values = {TIME: next(iter(axes.values())), **values}
    if called:
        labels = {TIME: next(iter(called.values())), **labels}
    return Columns(
        values,
        labels,
        np.array(rows, dtype=np.int64),
        layout.notes,
        units={signal: unit for signal, unit in units.items() if unit},
        names=layout.names,
        axes={} if shared else axes,
        clocks={} if shared else called,
    )


def _clocks(
    path: Path, columns: Mapping[str, ColumnMapping], layout: Layout, found: Mapping[str, int]
) -> dict[str, list[int]]:
    """Return the columns of time by which each signal may go; those of time itself where there is no signal."""
    given = {
        signal: position
        for signal in found
        if (time := columns[signal].time) is not None
        and (position := _position(path, f"{signal}, time", ColumnMapping(time), layout, False)) is not None
    }
    own = possible_clocks(layout.names, found, given, None)
    every_one = bool(found) and all(own.values())
    # The time of all signals may be missing, or be several columns of one name, where each signal has its own.
    ambiguous = layout.names.count(str(columns[TIME].name)) > 1
    declared = (
        None if every_one and ambiguous else _position(path, TIME, columns[TIME], layout, optional=every_one)
    )
    if not found:
        assert declared is not None
        return {TIME: [declared]}
    return possible_clocks(layout.names, found, given, declared)


def _filled(stamps: NDArray[np.float64], column: NDArray[np.float64]) -> int:
    """Return the number of rows up to the last in which a signal or its time is given."""
    filled = np.flatnonzero(~(np.isnan(stamps) & np.isnan(column)))
    return int(filled[-1]) + 1 if filled.size else 0


def _position(path: Path, signal: str, mapping: ColumnMapping, layout: Layout, optional: bool) -> int | None:
    """Return the index of a signal's column, None if it is missing and may be."""
    listed = ", ".join(f"'{name}'" for name in layout.names)
    if isinstance(mapping.name, int):
        if 1 <= mapping.name <= len(layout.names):
            return mapping.name - 1
        raise InputError(
            f"{path.name}: signal '{signal}' is mapped to column {mapping.name}, but the columns are 1 to {len(layout.names)}: "
            f"{listed}."
        )
    count = layout.names.count(mapping.name)
    if count == 1:
        return layout.names.index(mapping.name)
    if count > 1:
        raise InputError(
            f"{path.name}: {count} columns are called '{mapping.name}'; "
            f"name the one for signal '{signal}' by its number, counted from 1."
        )
    # Of several columns of one name, all but the first have a number behind it where a file is inspected.
    if mapping.name in (distinct := distinct_names(layout.names)):
        return distinct.index(mapping.name)
    if mapping.name.isdecimal() and 1 <= int(mapping.name) <= len(layout.names):
        return int(mapping.name) - 1
    if optional:
        return None
    if not layout.has_names:
        raise InputError(
            f"{path.name} has no header, so there is no column '{mapping.name}' for signal '{signal}'; "
            f"name it by its number, 1 to {len(layout.names)}: {signal} = 1, for instance."
        )
    hint = nearest(mapping.name, layout.names)
    raise InputError(
        f"{path.name} has no column '{mapping.name}' for signal '{signal}'.{hint} Its columns: {listed}. "
        "Map it under columns, or specify the separator if these are not the columns."
    )


def _numbers(
    path: Path,
    lines: Sequence[str],
    rows: Sequence[int],
    layout: Layout,
    found: Mapping[str, int],
    *,
    blank: bool,
) -> NDArray[np.float64]:
    """Return the columns asked for, shape (n_rows, n_columns asked for); a cell may be blank if that is said."""
    dialect = layout.dialect
    texts = [lines[number - 1] for number in rows]
    _check_widths(path, texts, rows, layout)
    if dialect.decimal == ",":
        if any("." in text for text in texts):
            _report_culprit(path, texts, rows, layout, found)
        texts = [text.replace(",", ".") for text in texts]
    try:
        table = np.loadtxt(
            texts,
            delimiter=None if dialect.separator == " " else dialect.separator,
            usecols=list(found.values()),
            quotechar='"',
            comments=None,
            converters=_number_or_blank if blank else None,
            ndmin=2,
        )
    except ValueError:
        _report_culprit(path, [lines[number - 1] for number in rows], rows, layout, found, blank=blank)
        raise InputError(
            f"{path.name} cannot be read as numbers; specify separator and decimal sign."
        ) from None
    return np.asarray(table, dtype=np.float64)


def _number_or_blank(cell: str) -> float:
    return float(cell) if cell.strip() else float("nan")


def _check_widths(path: Path, texts: Sequence[str], rows: Sequence[int], layout: Layout) -> None:
    """Refuse rows of another width: a cut last line, or a decimal comma between commas."""
    separator = layout.dialect.separator
    width = len(layout.names)
    for text, number in zip(texts, rows, strict=True):
        n_cells = len(text.split()) if separator == " " else text.count(separator) + 1
        if n_cells != width and (n_cells := len(layout.dialect.cells(text))) != width:
            ends = number == rows[-1]
            remedy = (
                "The file ends there: delete the incomplete line."
                if ends
                else "Correct the line, or specify separator and decimal sign."
            )
            raise InputError(f"{path.name}, line {number}: {n_cells} columns, but {width} above it. {remedy}")


def _report_culprit(
    path: Path,
    texts: Sequence[str],
    rows: Sequence[int],
    layout: Layout,
    found: Mapping[str, int],
    *,
    blank: bool = False,
) -> None:
    """Raise for the first cell that is not a number; slow, so only after the fast reading failed."""
    dialect = layout.dialect
    for text, number in zip(texts, rows, strict=True):
        cells = dialect.cells(text)
        for signal, position in found.items():
            cell = cells[position]
            if dialect.number(cell) is not None or (blank and not cell.strip()):
                continue
            other = Dialect(dialect.separator, "," if dialect.decimal == "." else ".")
            if not cell:
                what = "the cell is empty. Cut the record there or fill the gap before reading."
            elif other.number(cell) is not None:
                what = f"'{cell}' has a decimal sign other than '{dialect.decimal}'. Specify it: decimal = \"{other.decimal}\"."
            else:
                what = f"'{cell}' is not a number. Correct the cell."
                if signal.startswith("time "):
                    what += " Time is a number, not a date."
            raise InputError(f"{path.name}, line {number}, column '{layout.names[position]}': {what}")
