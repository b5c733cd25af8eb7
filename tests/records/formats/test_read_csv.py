from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping
from rigsight.records.channel_table import read_columns

ROWS = np.array([[0.0, 1.5, -2.25], [0.1, 1e-3, 3.5], [0.2, -7.0, 4.125], [0.3, 0.5, 1.0]])
BY_NAME = {name: ColumnMapping(name) for name in "tux"}
BY_NUMBER = {name: ColumnMapping(number) for number, name in enumerate("tux", 1)}


def text(separator: str = ",", decimal: str = ".", header: str = "t{0}u{0}x\n", end: str = "\n") -> str:
    rows = [separator.join(f"{value:.6f}".replace(".", decimal) for value in row) for row in ROWS]
    return (header.format(separator) + "\n".join(rows) + "\n").replace("\n", end)


def read(
    tmp_path: Path, content: str | bytes, columns: dict[str, ColumnMapping] = BY_NAME, **options: object
) -> np.ndarray:
    path = tmp_path / "log.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return np.column_stack(
        list(read_columns(path, columns, time_is_mapped=True, dialect=options).values.values())
    )


SEPARATORS = [",", ";", "\t", "|", " ", "  ", ", ", " ; "]


@pytest.mark.parametrize(
    ("separator", "decimal"),
    [(separator, ".") for separator in SEPARATORS]
    + [(separator, ",") for separator in SEPARATORS if "," not in separator],
)
def test_separator_and_decimal_sign_are_found_out(tmp_path: Path, separator: str, decimal: str) -> None:
    np.testing.assert_allclose(read(tmp_path, text(separator, decimal)), ROWS)


@pytest.mark.parametrize(
    "content",
    [
        text(end="\r\n"),
        text(end="\r"),
        "\ufeff" + text(),
        text().encode("utf-16"),
        text(header="# messung am Prüfstand\nt,u,x\n").encode("latin-1"),
        text(header="% made by a logger\n// second remark\n\nt,u,x\n"),
        text(header='"t","u","x"\n'),
        text(header="t, u , x\n"),
        text(header="# t,u,x\n"),
        text(header="t,u,x\ns,A,mm\n"),
        text(header="t,u,x\n[s],[A],\n"),
        text() + "\n\n# end of record\n",
        text().rstrip("\n"),
        text().replace("1.500000", '"1.5"'),
    ],
)
def test_dialects_give_the_same_numbers(tmp_path: Path, content: str | bytes) -> None:
    np.testing.assert_allclose(read(tmp_path, content), ROWS)


def test_columns_of_a_file_without_header_go_by_number(tmp_path: Path) -> None:
    np.testing.assert_allclose(read(tmp_path, text(header=""), BY_NUMBER), ROWS)
    two = {"t": ColumnMapping(1), "u": ColumnMapping("2")}
    np.testing.assert_allclose(read(tmp_path, text(header=""), two), ROWS[:, :2])


def test_a_header_of_numbers_can_be_told(tmp_path: Path) -> None:
    content = text(header="1,2,3\n")
    assert len(read(tmp_path, content, BY_NUMBER)) == 5
    assert len(read(tmp_path, content, BY_NUMBER, header=True)) == 4


def test_columns_that_nobody_asked_for_may_hold_anything(tmp_path: Path) -> None:
    content = "t,state,u\n" + "".join(f"{i},run {i},{i}\n" for i in range(5))
    np.testing.assert_allclose(
        read(tmp_path, content, {"t": ColumnMapping("t"), "u": ColumnMapping("u")})[:, 1], np.arange(5)
    )


def test_units_row_is_noted(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(header="t,u,x\ns,mA,mm\n"))
    (note,) = read_columns(path, BY_NAME, time_is_mapped=True).notes
    assert "line 2" in note
    assert "mA" in note


def test_rows_know_their_line_in_the_file(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text(header="# remark\n\nt,u,x\n"))
    np.testing.assert_array_equal(read_columns(path, BY_NAME, time_is_mapped=True).lines, [4, 5, 6, 7])


def test_scale_and_offset_give_si() -> None:
    np.testing.assert_allclose(
        ColumnMapping("u", scale=2.0, offset=-1.0).to_si(np.array([0.0, 3.0])), [-1.0, 5.0]
    )


def test_long_files_keep_every_row(tmp_path: Path) -> None:
    block = "".join(f"{i},{i % 7},{i % 11}\n" for i in range(1000))
    path = tmp_path / "long.csv"
    path.write_text("t,u,x\n" + block * 300)
    assert read_columns(path, BY_NAME, time_is_mapped=True).values["u"].size == 300_000


BROKEN: list[tuple[str, str | bytes, dict[str, object], list[str]]] = [
    (
        "text in a cell",
        text().replace("-7.000000", "seven"),
        {},
        ["line 4", "column 'u'", "'seven' is not a number"],
    ),
    ("empty cell", text().replace("-7.000000", ""), {}, ["line 4", "column 'u'", "empty"]),
    ("NaN", text().replace("4.125000", "NaN"), {}, ["line 4", "column 'x'", "nan is not a finite number"]),
    ("Inf", text().replace("4.125000", "-inf"), {}, ["line 4", "column 'x'", "-inf"]),
    ("cut last line", text()[:-12], {}, ["line 5", "2 columns", "incomplete line"]),
    ("extra cell", text().replace("1.500000", "1.5,8"), {}, ["line 2", "4 columns, but 3"]),
    ("decimal comma told wrong", text(";", ","), {"decimal": "."}, ["line 2", 'decimal = ","']),
    ("decimal point told wrong", text(";"), {"decimal": ","}, ["line 2", 'decimal = "."']),
    ("separator is decimal", text(), {"separator": ",", "decimal": ","}, ["both ','"]),
    ("wrong separator", text(), {"separator": ";"}, ["no column 'u'", "'t,u,x'", "separator"]),
    ("column missing", text().replace("u", "curent"), {}, ["no column 'u'", "'t', 'curent', 'x'"]),
    ("column twice", text().replace("x", "u", 1), {}, ["2 columns are called 'u'", "number"]),
    ("no header", text(header=""), {}, ["no header", "1 to 3"]),
    ("empty", "", {}, ["empty", "header and rows"]),
    ("comments only", "# nothing\n\n", {}, ["empty"]),
    ("header only", "t,u,x\n", {}, ["no rows of numbers"]),
    ("binary", b"\x00\x01\x02" * 50, {}, ["not a text file", "CSV"]),
    ("spreadsheet", b"PK\x03\x04rest", {}, ["not a text file", "CSV"]),
]


@pytest.mark.parametrize(
    ("content", "options", "reported"), [case[1:] for case in BROKEN], ids=[case[0] for case in BROKEN]
)
def test_broken_files_are_told_with_place_and_mend(
    tmp_path: Path, content: str | bytes, options: dict[str, object], reported: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, content, **options)
    for fragment in ["log.csv", *reported]:
        assert fragment in str(caught.value)


def test_column_number_beyond_the_last_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="column 4, but the columns are 1 to 3"):
        read(tmp_path, text(), {"u": ColumnMapping(4)})


def test_missing_file_and_folder_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        read_columns(tmp_path / "none.csv", BY_NAME, time_is_mapped=True)
    with pytest.raises(InputError, match="is a folder"):
        read_columns(tmp_path, BY_NAME, time_is_mapped=True)


def test_too_large_a_file_is_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rigsight.records.formats.text_channels.LARGEST_FILE", 10)
    with pytest.raises(InputError, match="more than the 1e-08 GB"):
        read(tmp_path, text())


@pytest.mark.parametrize("scale", [0.0, float("inf"), float("nan")])
def test_scale_without_meaning_is_refused(scale: float) -> None:
    with pytest.raises(InputError, match="scale must be a finite number other than 0"):
        ColumnMapping("u", scale=scale)


@pytest.mark.parametrize("sign", [",", "."])
def test_a_sign_between_thousands_is_not_taken_for_the_decimal_sign(tmp_path: Path, sign: str) -> None:
    x = np.round(40000.0 * np.sin(0.1 * np.arange(80))).astype(int)
    cells = [f"{value:,d}".replace(",", sign) for value in x]
    rows = "\n".join(f"{i};0;{cell}" for i, cell in enumerate(cells))
    first = next(i for i, cell in enumerate(cells) if sign in cell)
    with pytest.raises(InputError, match=rf"line {first + 2}, column 'x': '{cells[first]}' .*thousands"):
        read(tmp_path, f"t;u;x\n{rows}\n")


@pytest.mark.parametrize("form", ["{:.3f}", "{:g}", "{:.1f}"])
def test_decimals_are_not_taken_for_thousands(tmp_path: Path, form: str) -> None:
    x = np.round(40.0 * np.sin(0.1 * np.arange(80)), 3)
    rows = "\n".join(f"{i};0;{form.format(value).replace('.', ',')}" for i, value in enumerate(x))
    read_x = read(tmp_path, f"t;u;x\n{rows}\n")[:, 2]
    np.testing.assert_allclose(read_x, [float(form.format(value)) for value in x], rtol=1e-14)


@pytest.mark.parametrize("remark", ["", "\t"])
def test_a_labview_measurement_is_read_with_and_without_cells_for_remarks(
    tmp_path: Path, remark: str
) -> None:
    head = (
        "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n"
        "Samples\t4\t4\t\nX_Dimension\tTime\tTime\t\nDelta_X\t0.1\t0.1\t\n***End_of_Header***\t\t\t\n"
    )
    rows = "".join("\t".join(f"{value:.6f}" for value in row) + remark + "\n" for row in ROWS)
    columns = {"t": ColumnMapping("X_Value"), "u": ColumnMapping("Drive"), "x": ColumnMapping("Place")}
    content = f"{head}X_Value\tDrive\tPlace\tComment\n{rows}"
    np.testing.assert_allclose(read(tmp_path, content, columns), ROWS)
