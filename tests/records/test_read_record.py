from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, read_record


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


INPUTS = (Named("u", "A"),)
OUTPUTS = (Named("psi", "rad"), Named("y", "m"))
WriteCsv = Callable[..., Path]


def replaced(column: int, value: str) -> Callable[[list[str]], None]:
    def change(lines: list[str]) -> None:
        for i in range(1, len(lines)):
            cells = lines[i].split(",")
            cells[column] = value
            lines[i] = ",".join(cells)

    return change


def test_a_file_becomes_a_record_in_si(write_csv: WriteCsv) -> None:
    path = write_csv(header="ms,mA,psi,y")
    columns = {
        "t": ColumnMapping("ms", scale=1e-3, offset=5.0),
        "u": ColumnMapping("mA", scale=1e-3, offset=0.25),
    }
    record = read_record(
        path,
        INPUTS,
        OUTPUTS,
        ReadingOptions(columns=columns, role="validation", kind="sweep", amplitude=0.5),
    )
    assert record.name == "sweep"
    assert (record.dt, record.t0, record.n_samples) == (pytest.approx(1e-5), 5.0, 200)
    assert record["u"][0] == 0.25
    assert dict(record.units) == {"t": "s", "u": "A", "psi": "rad", "y": "m"}
    assert (record.role, record.kind, record.amplitude, record.source) == ("validation", "sweep", 0.5, path)


def test_second_output_may_be_missing_but_not_the_first(write_csv: WriteCsv) -> None:
    assert "y" not in read_record(write_csv(header="t,u,psi,other"), INPUTS, OUTPUTS)
    with pytest.raises(InputError, match="no column 'psi'"):
        read_record(write_csv(header="t,u,angle,y"), INPUTS, OUTPUTS)


def test_a_column_called_nearly_like_a_missing_output_is_told(write_csv: WriteCsv) -> None:
    height = (OUTPUTS[0], Named("height", "m"))
    record = read_record(write_csv(header="t,u,psi,hight"), INPUTS, height)
    assert "height" not in record
    assert any("no column 'height'" in note and "mean 'hight'" in note for note in record.notes)
    assert not any("height" in n for n in read_record(write_csv(header="t,u,psi,oil"), INPUTS, height).notes)


def test_a_second_output_that_was_mapped_must_be_there(write_csv: WriteCsv) -> None:
    with pytest.raises(InputError, match="no column 'lateral' for signal 'y'"):
        read_record(write_csv(), INPUTS, OUTPUTS, ReadingOptions(columns={"y": ColumnMapping("lateral")}))


def test_time_and_input_suffice_to_simulate(write_csv: WriteCsv) -> None:
    rows = np.column_stack([0.01 * np.arange(60), np.ones(60)])
    record = read_record(
        write_csv(rows=rows, header="t,u"), INPUTS, OUTPUTS, ReadingOptions(require_outputs=False)
    )
    assert list(record.signals) == ["u"]


def test_still_second_output_is_left_out_and_said(write_csv: WriteCsv) -> None:
    record = read_record(write_csv(change=replaced(3, "0.5")), INPUTS, OUTPUTS)
    assert "y" not in record
    assert "y never changes" in record.notes[0]


def test_a_still_output_cannot_be_fitted(write_csv: WriteCsv) -> None:
    with pytest.raises(InputError, match="output psi never changes"):
        read_record(write_csv(change=replaced(2, "0.5")), INPUTS, OUTPUTS)


def test_a_still_input_is_a_free_motion_and_said(write_csv: WriteCsv) -> None:
    record = read_record(write_csv(change=replaced(1, "0.5")), INPUTS, OUTPUTS)
    assert set(record["u"]) == {0.5}
    assert "column 'u': no input changes (u = 0.5)" in record.notes[-1]


def test_a_still_input_of_a_step_is_a_step_with_which_the_record_begins(write_csv: WriteCsv) -> None:
    record = read_record(
        write_csv(change=replaced(1, "0.5")), INPUTS, OUTPUTS, ReadingOptions(kind="step", amplitude=0.5)
    )
    assert set(record["u"]) == {0.5}
    assert "column 'u': no input changes (u = 0.5); taken as a step" in record.notes[-1]
    with pytest.raises(InputError, match="no input changes"):
        read_record(write_csv(change=replaced(1, "0")), INPUTS, OUTPUTS, ReadingOptions(kind="step"))


@pytest.mark.parametrize(
    "options",
    [
        {"kind": "sweep"},
        {"amplitude": 0.5},
        {"moving_inputs": ("u",)},
        {"moving_inputs": ("u",), "kind": "step"},
    ],
    ids=["kind", "amplitude", "element", "element that steps"],
)
def test_a_still_input_that_is_said_to_move_is_refused(write_csv: WriteCsv, options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"no input changes \(u = 0\.5\).* Check the column"):
        read_record(write_csv(change=replaced(1, "0.5")), INPUTS, OUTPUTS, ReadingOptions(**options))


def test_free_decay_may_be_scored(write_csv: WriteCsv) -> None:
    record = read_record(
        write_csv(change=replaced(1, "0")), INPUTS, OUTPUTS, ReadingOptions(role="validation")
    )
    assert not record["u"].any()


def test_a_column_of_no_signal_is_refused(write_csv: WriteCsv) -> None:
    with pytest.raises(
        InputError, match=r"sweep.csv: columns names 'Psi', .* Did you mean 'psi'\? Signals: t, u, psi, y\."
    ):
        read_record(
            write_csv(), INPUTS, OUTPUTS, ReadingOptions(columns={"Psi": ColumnMapping("psi", unit="deg")})
        )


def test_a_column_may_be_a_name_or_a_number(write_csv: WriteCsv) -> None:
    path = write_csv(header="t,current,psi,y")
    record = read_record(path, INPUTS, OUTPUTS, ReadingOptions(columns={"u": "current", "y": 4}))
    assert list(record.signals) == ["u", "psi", "y"]
    with pytest.raises(InputError, match=r"the column of u must be its name, .* got \['current'\]\."):
        read_record(path, INPUTS, OUTPUTS, ReadingOptions(columns={"u": ["current"]}))  # type: ignore[dict-item]


def test_time_that_runs_backwards_by_its_scale_is_refused(write_csv: WriteCsv) -> None:
    with pytest.raises(InputError, match="scale of time must be positive"):
        read_record(
            write_csv(), INPUTS, OUTPUTS, ReadingOptions(columns={"t": ColumnMapping("t", scale=-1.0)})
        )
