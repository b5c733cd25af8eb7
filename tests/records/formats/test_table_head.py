"""What loggers write above a table is passed over and said; where nobody can say which line holds the names, that is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping
from rigsight.records.channel_table import open_measurement, read_columns
from rigsight.records.column_mapping import Columns

T = 0.01 * np.arange(80)
TABLE = {"t": T, "u": np.sin(9.0 * T), "x": 1.0 + np.cos(7.0 * T)}


def rows(separator: str = ";", decimal: str = ".") -> str:
    lines = (
        separator.join(f"{v:.6f}".replace(".", decimal) for v in row)
        for row in zip(*TABLE.values(), strict=True)
    )
    return "\n".join(lines) + "\n"


def read(
    tmp_path: Path, text: str, names: tuple[str | int, ...] = ("t", "u", "x"), **options: object
) -> Columns:
    path = tmp_path / "log.csv"
    path.write_text(text, encoding="utf-8")
    columns = {signal: ColumnMapping(name) for signal, name in zip(TABLE, names, strict=True)}
    return read_columns(path, columns, time_is_mapped=True, dialect=options)


def agrees(found: Columns) -> bool:
    return all(np.allclose(found.values[name], samples, atol=1e-6) for name, samples in TABLE.items())


GERMAN = ("Zeit", "Antrieb", "Weg")
HEADS: dict[str, tuple[str, str, str, tuple[str | int, ...]]] = {
    "names alone": ("t;u;x\n", ";", ".", ("t", "u", "x")),
    "as wide as the table": ("Test bench 7;Date 2026-03-01;Kim\nt;u;x\ns;A;m\n", ";", ".", ("t", "u", "x")),
    "narrower": ("Test bench 7;Date 2026-03-01\nt;u;x\ns;A;m\n", ";", ".", ("t", "u", "x")),
    "wider": ("Test bench 7;Date;2026-03-01;Kim;3\nt;u;x\n", ";", ".", ("t", "u", "x")),
    "several lines": ("Bench 7\nDate: 2026-03-01 10:22\nOperator;Kim\nRate;100\n\nt;u;x\ns;A;m\n", ";", ".", ("t", "u", "x")),
    "padded by a spreadsheet": ("Bench 7;;\nDate;2026-03-01;\n;;\nt;u;x\n", ";", ".", ("t", "u", "x")),
    "numbers among the words": ("Bench;7;3\nRate;100;1\nt;u;x\n", ";", ".", ("t", "u", "x")),
    "a table of numbers above": ("Channel;Range;Gain\n1;10;2\n2;5;2\nt;u;x\ns;A;m\n", ";", ".", ("t", "u", "x")),
    "separator declared": ("sep=;\nt;u;x\n", ";", ".", ("t", "u", "x")),
    "decimal commas": ("Prüfstand 7;Datum 01.03.2026\nZeit;Antrieb;Weg\ns;A;m\n", ";", ",", GERMAN),
    "decimal commas and tabs": ("Prüfstand 7, Halle 3\n01.03.2026\nZeit\tAntrieb\tWeg\n", "\t", ",", GERMAN),
    "commas": ("Bench 7, hall 3\nt,u,x\ns,A,m\n", ",", ".", ("t", "u", "x")),
    "blanks": ("Test bench 7 on 2026-03-01 by Kim\nt u x\ns A m\n", " ", ".", ("t", "u", "x")),
    "units in words": ("t;u;x\nSekunden;Ampere;Meter\n", ";", ".", ("t", "u", "x")),
    "asked for by number": ("Bench 7;Kim\nZeit;Antrieb;Weg\n", ";", ".", (1, 2, 3)),
    "no names, a blank line between": ("Bench 7;Kim\n\n", ";", ".", (1, 2, 3)),
    "names in a comment": ("Bench 7;Kim\n# t;u;x\n", ";", ".", ("t", "u", "x")),
    "a hundred lines": ("".join(f"Key {i};value {i}\n" for i in range(100)) + "t;u;x\n", ";", ".", ("t", "u", "x")),
}  # fmt: skip


@pytest.mark.parametrize(("head", "separator", "decimal", "names"), HEADS.values(), ids=HEADS)
def test_the_table_below_is_read(
    tmp_path: Path, head: str, separator: str, decimal: str, names: tuple[str | int, ...]
) -> None:
    found = read(tmp_path, head + rows(separator, decimal), names)
    assert agrees(found)
    # Each row knows its line, so that messages name the right one.
    assert found.lines[0] == head.count("\n") + 1


def test_what_was_passed_over_is_said(tmp_path: Path) -> None:
    found = read(tmp_path, "Bench 7;Kim\nRate;100\nt;u;x\ns;A;m\n" + rows())
    assert "2 lines above the names in line 3 are not part of the table" in found.notes[0]
    assert "line 4: taken as a row of units (s, A, m)" in found.notes[1]
    assert read(tmp_path, "t;u;x\n" + rows()).notes == ()


def test_inspect_finds_names_and_units_without_being_asked(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("Bench 7;Kim;early\nZeit;Kraft;Weg\ns;kN;mm\n" + rows(), encoding="utf-8")
    with open_measurement(path) as file:
        assert [channel.name for channel in file.channels] == ["Zeit", "Kraft", "Weg"]
        assert [channel.unit for channel in file.channels] == ["s", "kN", "mm"]


def test_the_line_of_the_names_can_be_told(tmp_path: Path) -> None:
    text = "one;two;three\nfour;five;six\n" + rows()
    assert agrees(read(tmp_path, text, ("one", "two", "three"), header=1))
    assert agrees(read(tmp_path, text, ("four", "five", "six"), header=2))
    assert agrees(read(tmp_path, "Bench 7;8\n" + rows(), (1, 2, 3), header=False))


REFUSED: dict[str, tuple[str, dict[str, object], str]] = {
    "names for fewer columns": (
        "t;u\n" + rows(),
        {},
        r"line 1 has 2 columns.*below it have 3.*header = false",
    ),
    "a table begun anew": ("t;u;x\n" + rows() + "t;u;x\n" + rows(), {}, r"line 82.*not a number"),
    "begun anew at once": ("t;u;x\n0;1;2\nt;u;x\n" + rows(), {}, r"begin in lines 2 and 4.*header = LINE"),
    "text in the first row": ("t;u;x\n0;one;2\n" + rows(), {}, r"line 2, column 'u': 'one' is not a number"),
    "many lines of words": ("t;u;x\ns;A;m\nraw;raw;raw\n" + rows(), {}, r"lines 1 to 3 are all above"),
    "a line that is not there": ("t;u;x\n" + rows(), {"header": 900}, r"header = 900: that line is blank"),
    "a cut row": ("Bench 7\nt;u;x\n" + rows() + "1;2\n", {}, r"line 83: 2 columns, but 3 above it"),
}


@pytest.mark.parametrize(("text", "options", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_unclear_is_told_with_its_lines(
    tmp_path: Path, text: str, options: dict[str, object], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text, **options)  # type: ignore[arg-type]


def test_rows_shorter_than_the_header_lack_numbers_that_end_no_command(tmp_path: Path) -> None:
    # Found by the fuzzer: numbers with three decimals are looked at for signs between thousands, row by row.
    path = tmp_path / "log.csv"
    rows = [
        f"{row}" if row % 3 == 0 else f"{row}\t{row if row % 3 == 1 else row + (0.125 if row < 9 else 0.5)}"
        for row in range(1, 200)
    ]
    path.write_text("t\tu\n" + "\n".join(rows) + "\n", encoding="utf-8")
    with open_measurement(path) as file:
        assert len(list(file.channels)) == 2
