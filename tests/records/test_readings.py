"""A record holds what its sensors read: codes are refused, turns are unwrapped, held readings interpolated between their rows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, Record, read_record

from .formats.files import write_parquet, write_text


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


DT = 0.002
T = DT * np.arange(3000)
U = np.sign(np.sin(5.0 * T + 0.1))
ANGLE = 9.0 * np.sin(2.0 * T) + 1.0


def read(path: Path, unit: str = "rad", **options: object) -> Record:
    return read_record(path, (Named("u", "A"),), (Named("x", unit),), ReadingOptions(**options))


def write(path: Path, x: np.ndarray) -> Path:
    write_text(path, {"t": T, "u": U, "x": x}, {})
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_codes_are_refused_with_every_row(tmp_path: Path, suffix: str) -> None:
    x = 1e-3 * ANGLE
    x[[40, 41, 99]] = -9999.0
    path = tmp_path / f"run{suffix}"
    (write_text if suffix == ".csv" else write_parquet)(path, {"t": T, "u": U, "x": x}, {})
    with pytest.raises(InputError) as caught:
        read(path, "m")
    rows = "lines 42, 43, 101" if suffix == ".csv" else "samples 41, 42, 100"
    for part in (path.name, "'x'", "-9999", rows):
        assert part in str(caught.value)


@pytest.mark.parametrize(("turn", "unit"), [(2.0 * np.pi, "rad"), (360.0, "deg")])
def test_an_angle_goes_on_behind_a_full_turn(tmp_path: Path, turn: float, unit: str) -> None:
    path = write(tmp_path / "run.csv", np.mod(ANGLE * turn / (2.0 * np.pi), turn))
    columns = {"x": ColumnMapping("x", unit=unit)}
    record = read(path, columns=columns)
    np.testing.assert_allclose(record["x"], ANGLE, atol=1e-9)
    assert any("unwrap" in note for note in record.notes)
    as_it_is = read(path, columns={"x": ColumnMapping("x", unit=unit, unwrap=False)})
    assert np.ptp(as_it_is["x"]) < 2.0 * np.pi


def test_an_angle_in_degrees_is_not_taken_for_radians(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", np.mod(np.degrees(ANGLE), 360.0))
    with pytest.raises(InputError, match='unit = "deg"'):
        read(path)


@pytest.mark.parametrize("declared", [None, 65536.0])
def test_a_counter_goes_on_behind_its_end(tmp_path: Path, declared: float | None) -> None:
    count = np.round(1e4 * ANGLE)
    path = write(tmp_path / "run.csv", np.mod(count, 65536.0))
    record = read(path, "m", columns={"x": ColumnMapping("x", scale=1e-6, unwrap=declared)})
    np.testing.assert_allclose(record["x"], 1e-6 * count, atol=1e-12)


def test_a_counter_of_any_range_goes_on_where_it_is_declared(tmp_path: Path) -> None:
    count = np.round(1e4 * ANGLE)
    path = write(tmp_path / "run.csv", np.mod(count, 40000.0))
    record = read(path, "m", columns={"x": ColumnMapping("x", scale=1e-6, unwrap=40000.0)})
    np.testing.assert_allclose(record["x"], 1e-6 * count, atol=1e-12)


def test_unwrapping_that_makes_no_sense_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "run.csv", ANGLE)
    with pytest.raises(InputError, match="needs an angle"):
        read(path, "m", columns={"x": ColumnMapping("x", unwrap=True)})
    with pytest.raises(InputError, match="span"):
        read(path, "m", columns={"x": ColumnMapping("x", unwrap=5.0)})
    with pytest.raises(InputError, match="unwrap must be"):
        ColumnMapping("x", unwrap=-1.0)


@pytest.mark.parametrize("rows", [5, 10])
def test_a_held_reading_is_used_at_its_own_rows_only(tmp_path: Path, rows: int) -> None:
    path = write(tmp_path / "run.csv", ANGLE[np.arange(T.size) // rows * rows])
    record = read(path)
    assert record.n_samples == T.size - rows + 1
    # Held, it would be late by up to 18 % of its range per row of ten.
    np.testing.assert_allclose(record["x"], ANGLE[: record.n_samples], atol=1e-4)
    np.testing.assert_array_equal(record["u"], U[: record.n_samples])
    (note,) = [note for note in record.notes if f"every {rows} rows" in note]
    assert "'x'" in note


def test_a_held_command_stays_held(tmp_path: Path) -> None:
    u = np.repeat(np.random.default_rng(2).standard_normal(300), 10)
    path = tmp_path / "run.csv"
    write_text(path, {"t": T, "u": u, "x": ANGLE}, {})
    record = read(path)
    np.testing.assert_array_equal(record["u"], u)
    np.testing.assert_array_equal(record["x"], ANGLE)
