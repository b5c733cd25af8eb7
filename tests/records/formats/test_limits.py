"""What a file claims too much of is refused with the limit, before anything of that size is held."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ReadingOptions, read_record
from rigsight.records.formats.channel import (
    MOST_IN_TABLE,
    Channel,
    Refused,
    check_total,
    columns_of,
    kept_last,
)
from rigsight.workflow.inspect import run_inspect

from .files import write_parquet
from .test_damaged_formats import HEADER, Named, element, matrix

T = 0.01 * np.arange(60)
ROWS = {"t": T, "u": np.sin(9 * T), "psi": np.cos(9 * T)}


def read(path: Path, **options: object) -> None:
    read_record(path, (Named("u", "A"),), (Named("psi", "rad"),), ReadingOptions(**options))  # type: ignore[arg-type]


def csv_text(**changed: np.ndarray) -> str:
    rows = {**ROWS, **changed}
    lines = (",".join(repr(float(value)) for value in row) for row in zip(*rows.values(), strict=True))
    return ",".join(rows) + "\n" + "\n".join(lines) + "\n"


@pytest.mark.parametrize("name", ["run.csv", "run.mat"])
def test_a_pipe_has_no_end_and_is_not_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=f"{name} is a device or a pipe"):
        run_inspect(tmp_path / name)


def test_nulls_anywhere_in_a_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    path.write_text(csv_text() * 30, encoding="utf-8")
    with path.open("r+b") as stream:
        # As large as is read, and sparse: all of it in memory would be told by the machine.
        stream.truncate(1_999_999_999)
    with pytest.raises(InputError, match="not a text file"):
        run_inspect(path)


def test_a_line_without_end_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_bytes(b"1," * 1_500_000)
    with pytest.raises(InputError, match="a line of more than 1 MB"):
        run_inspect(tmp_path / "run.csv")


def test_more_lines_than_samples_are_read_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rigsight.records.formats.text_channels._MOST_LINES", 1000)
    (tmp_path / "run.csv").write_text("t,u\n" + "\n" * 1001, encoding="utf-8")
    with pytest.raises(InputError, match="more than 1000 lines"):
        run_inspect(tmp_path / "run.csv")


def test_short_rows_below_a_wide_header_are_refused(tmp_path: Path) -> None:
    header = ",".join(f"c{i}" for i in range(1000))
    rows = ["1," * 999 + "1"] * 60 + ["1,1"] * 5000
    (tmp_path / "run.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    with pytest.raises(InputError, match="shorter than the 1000 columns"):
        run_inspect(tmp_path / "run.csv")


def test_a_quoted_cell_of_any_length_is_told_or_read(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(f't,u,psi\n0,1,"{"x" * 200_000}"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"run\.csv"):
        read(tmp_path / "run.csv")


@pytest.mark.parametrize("separator", ['"', "\n", "\r", ";;", ""])
def test_a_separator_that_separates_nothing_is_refused(tmp_path: Path, separator: str) -> None:
    (tmp_path / "run.csv").write_text(csv_text(), encoding="utf-8")
    with pytest.raises(InputError, match="separator is"):
        read(tmp_path / "run.csv", separator=separator)


@pytest.mark.parametrize(
    ("changed", "reported"),
    [
        ({"u": 1e308 * ROWS["u"]}, "are implausible"),
        ({"t": 1e306 * T}, "which is implausible"),
        ({"t": 1e-320 * np.arange(60)}, "which is implausible"),
    ],
)
def test_numbers_that_nobody_measures_are_refused(
    tmp_path: Path, changed: dict[str, np.ndarray], reported: str
) -> None:
    (tmp_path / "run.csv").write_text(csv_text(**changed), encoding="utf-8")
    with pytest.raises(InputError, match=reported):
        read(tmp_path / "run.csv")


def test_a_sample_time_that_makes_endless_samples_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run.csv").write_text(csv_text(), encoding="utf-8")
    with pytest.raises(InputError, match="more than the limit of 50000000"):
        read(tmp_path / "run.csv", resample=1e-320)


def test_channels_that_are_too_long_together_are_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rigsight.records.formats.channel.MOST_SAMPLES_IN_ALL", 179)
    write_parquet(tmp_path / "run.parquet", ROWS, {})
    with pytest.raises(InputError, match="180 samples in total, more than the 179"):
        run_inspect(tmp_path / "run.parquet")
    check_total("run.parquet", 179)


def test_a_table_that_is_too_large_is_refused_unread() -> None:
    def fail() -> np.ndarray:
        pytest.fail("it was read")

    found = columns_of("table", (MOST_IN_TABLE // 60 + 1, 60), fail)
    assert isinstance(found[0], Refused)
    assert "more than the 200000000" in found[0].reason


def test_a_table_is_read_once_for_all_its_columns_and_not_kept_beside_the_next() -> None:
    n_read = []
    kept: dict[str, np.ndarray] = {}

    def table(name: str) -> list[np.ndarray]:
        found = columns_of(
            name, (9, 3), kept_last(kept, name, lambda: n_read.append(name) or np.ones((9, 3)))
        )
        assert all(isinstance(one, Channel) for one in found)
        return [channel.load() for channel in found]

    assert [len(table(name)) for name in ("a", "b")] == [3, 3]
    assert n_read == ["a", "b"]
    assert list(kept) == ["b"]


@pytest.mark.parametrize("sign", ["\x0c", "\x1b[2J", "\x7f", "\u2028", "\x85"])
def test_signs_that_no_list_can_hold_leave_names_and_the_proposal_is_toml(tmp_path: Path, sign: str) -> None:
    import tomllib

    text = csv_text().replace("t,u,psi", f"t,u{sign}b,psi [mm{sign}]")
    (tmp_path / "run.csv").write_text(text, encoding="utf-8")
    found = run_inspect(tmp_path / "run.csv")
    assert "\ufffd" in found.channels[1].name
    assert "records" in tomllib.loads(found.proposal)


@pytest.mark.skipif(sys.platform != "linux", reason="memory of a process is limited there")
def test_a_file_that_asks_for_more_memory_than_it_may_take_is_told(tmp_path: Path) -> None:
    # So many elements take 8 GB before the first of them is read.
    cells = matrix(1, (1 << 15, 1 << 15), element(14, b""))
    (tmp_path / "run.mat").write_bytes(HEADER + cells)
    with pytest.raises(
        InputError, match=r"run.mat needs more memory than the 4 GB that a file of its size may"
    ):
        read(tmp_path / "run.mat")
