"""A campaign written from the files of a folder."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from rigsight.errors import InputError
from rigsight.rigs import RIGS
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.init import run_init

from ...records.formats.files import write_mdf, write_parquet, write_text
from .sweep_of_columns import ANSWER, SWEEP, T


def test_clear_names_make_a_campaign_at_once(tmp_path: Path) -> None:
    for name in ("run_1.csv", "run_2.csv", "run_3.csv"):
        write_text(tmp_path / name, {"t": T, "u": 2.0 * SWEEP, "x": ANSWER}, {})
    draft = run_init(tmp_path)
    assert (draft.model, draft.n_blanks, len(draft.records)) == ("axis", 0, 3)
    campaign = read_campaign(tmp_path)
    assert campaign.rig.name == "axis"
    assert [record.role for record in campaign.records] == ["estimation", "estimation", "validation"]
    assert [record.kind for record in campaign.records] == ["sweep"] * 3
    assert campaign.records[0].amplitude == pytest.approx(2.0, rel=0.02)


def test_a_single_channel_is_the_reading_of_a_free_motion(tmp_path: Path) -> None:
    """Its name is that of an input: what a coil gives."""
    write_text(tmp_path / "blow.csv", {"t": T, "voltage": ANSWER}, {})
    draft = run_init(tmp_path)
    assert (draft.model, draft.n_blanks) == ("axis", 0)
    (record,) = tomllib.loads((tmp_path / "campaign.toml").read_text("utf-8"))["records"]
    assert record["columns"] == {"x": "voltage"}


@pytest.mark.slow
def test_units_in_names_are_written_and_applied(tmp_path: Path) -> None:
    odd = {"Zeit [ms]": 1e3 * T, "Anregung": SWEEP, "Signal/Weg mm": 1e3 * ANSWER, "Temperatur": ANSWER}
    write_text(tmp_path / "messung.csv", odd, {})
    write_parquet(tmp_path / "validierung.parquet", odd, {})
    run_init(tmp_path)
    first, second = read_campaign(tmp_path).records
    np.testing.assert_allclose(first["x"], ANSWER, rtol=1e-12)
    np.testing.assert_array_equal(second["x"], first["x"])
    assert (first.dt, second.role) == (pytest.approx(0.01, rel=1e-12), "validation")


def test_an_element_that_turns_is_drafted_as_one(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "Winkel [deg]": SWEEP, "Torque [kN m]": ANSWER}, {})
    run_init(tmp_path, model="element")
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["x"], np.radians(SWEEP), rtol=1e-12)
    np.testing.assert_allclose(record["force"], 1e3 * ANSWER, rtol=1e-12)
    assert "[N m s/rad]" in (tmp_path / "campaign.toml").read_text("utf-8")


def test_a_drive_in_kilonewtons_is_converted(tmp_path: Path) -> None:
    write_text(tmp_path / "run.csv", {"t": T, "Drive Force [kN]": 0.02 * SWEEP, "Pos [mm]": ANSWER}, {})
    run_init(tmp_path, model="axis")
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["u"], 20.0 * SWEEP, rtol=1e-12)
    assert record.amplitude == pytest.approx(20.0, rel=0.02)


def test_a_time_that_is_hardly_in_seconds_is_asked_about(tmp_path: Path) -> None:
    write_text(tmp_path / "run.csv", {"t": 1e3 * T, "u": SWEEP, "x": ANSWER}, {})
    run_init(tmp_path)
    assert "sample time of 10 s; is it in ms?" in (tmp_path / "campaign.toml").read_text("utf-8")


@pytest.mark.parametrize("name", RIGS)
def test_every_rig_is_recognized_by_the_names_of_its_signals(tmp_path: Path, name: str) -> None:
    inputs, outputs = RIGS[name].inputs, RIGS[name].outputs
    samples = {"t": T} | {signal.name: (i + 1.0) * SWEEP for i, signal in enumerate(inputs)}
    samples |= {signal.name: (i + 1.0) * ANSWER for i, signal in enumerate(outputs)}
    write_text(tmp_path / "a.csv", samples, {})
    assert run_init(tmp_path).model == name


@pytest.mark.parametrize(
    ("columns", "model"),
    [
        (("t", "Hub [mm]", "Kraft [kN]"), "element"),
        (("time", "motor current", "psi"), "running_gear"),
        (("t", "u", "position"), "axis"),
        (("time", "goal", "angle"), "servo"),
    ],
)
def test_the_kind_of_rig_is_guessed_from_the_channels(
    tmp_path: Path, columns: tuple[str, ...], model: str
) -> None:
    write_text(tmp_path / "a.csv", dict(zip(columns, (T, SWEEP, ANSWER), strict=True)), {})
    assert run_init(tmp_path).model == model


@pytest.mark.parametrize(
    ("columns", "model"),
    [
        (("t", "u", "y"), "axis"),
        (("time", "current", "y [mm]"), "axis"),
        (("Zeit", "Spannung", "Messwert"), "axis"),
        (("t", "u", "angle"), "axis"),
        (("t", "u", "yaw angle"), "running_gear"),
        (("t", "current", "lateral displacement"), "running_gear"),
        (("t", "u", "psi", "y"), "running_gear"),
    ],
)
def test_a_running_gear_is_proposed_only_where_a_channel_speaks_of_one(
    tmp_path: Path, columns: tuple[str, ...], model: str
) -> None:
    write_text(tmp_path / "a.csv", dict(zip(columns, (T, SWEEP, ANSWER, ANSWER), strict=False)), {})
    assert run_init(tmp_path).model == model


def test_the_last_channel_is_taken_for_the_last_signal_and_asked_about(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "y": ANSWER}, {})
    draft = run_init(tmp_path)
    text = draft.path.read_text("utf-8")
    assert 'x = "y"  # assumed in m; check; guessed: the only remaining channel; check' in text
    assert "init --model" in text
    assert "rigsight rigs NAME" in text
    np.testing.assert_array_equal(read_campaign(tmp_path).records[0]["x"], ANSWER)


@pytest.mark.parametrize(
    "further", [{}, {"velocity": ANSWER}, {"Oil [degC]": ANSWER}, {"row": np.arange(T.size)}]
)
def test_the_only_channel_that_can_drive_is_taken_for_the_input_and_asked_about(
    tmp_path: Path, further: dict[str, Any]
) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "demand": SWEEP, "x": ANSWER, **further}, {})
    text = run_init(tmp_path, model="axis").path.read_text("utf-8")
    assert 'u = "demand"' in text
    assert "check" in next(line for line in text.splitlines() if line.startswith("u ="))
    np.testing.assert_array_equal(read_campaign(tmp_path).records[0]["u"], SWEEP)


@pytest.mark.parametrize(
    "last",
    [
        {"demand": SWEEP, "request": ANSWER},
        {"Oil [degC]": ANSWER},
        {"row": np.arange(T.size)},
        {"velocity": ANSWER},
        {"still": 0.0 * T},
    ],
)
def test_what_cannot_drive_or_is_not_alone_is_no_input(tmp_path: Path, last: dict[str, Any]) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "x": ANSWER, **last}, {})
    assert 'u = "FILL IN"' in run_init(tmp_path, model="axis").path.read_text("utf-8")


def test_a_last_channel_of_another_unit_is_not_taken(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "Oil [degC]": ANSWER}, {})
    run_init(tmp_path, model="axis")
    assert 'x = "FILL IN"' in (tmp_path / "campaign.toml").read_text("utf-8")


def test_the_only_channel_of_a_unit_is_taken_whatever_it_is_called(tmp_path: Path) -> None:
    write_text(
        tmp_path / "a.csv", {"t": T, "Kraft [N]": SWEEP, "Abstand [mm]": 1e3 * ANSWER, "Temp [°C]": T}, {}
    )
    run_init(tmp_path, model="axis")
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["u"], SWEEP, rtol=1e-12)
    np.testing.assert_allclose(record["x"], ANSWER, rtol=1e-12)


def test_two_channels_of_a_unit_are_not_chosen_between(tmp_path: Path) -> None:
    forces = {"Kraft 1 [N]": SWEEP, "Kraft 2 [N]": 2.0 * SWEEP}
    write_text(tmp_path / "a.csv", {"t": T, **forces, "Weg [mm]": 1e3 * ANSWER}, {})
    run_init(tmp_path, model="axis")
    with pytest.raises(InputError, match="FILL IN"):
        read_campaign(tmp_path)


def test_blanks_are_refused_by_name_and_accepted_once_filled(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "psi": ANSWER}, {})
    draft = run_init(tmp_path)
    assert draft.n_blanks == 4
    with pytest.raises(InputError, match=r"rig.constants.v.*FILL IN"):
        read_campaign(tmp_path)
    text = draft.path.read_text(encoding="utf-8")
    draft.path.write_text(text.replace('"FILL IN"', "0.5", 4 + 1), encoding="utf-8")
    assert read_campaign(tmp_path).constants["v"] == 0.5


def test_ambiguous_channels_are_listed_and_not_guessed(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "Weg 1": ANSWER, "Weg 2": 2 * ANSWER}, {})
    draft = run_init(tmp_path, model="axis")
    text = draft.path.read_text(encoding="utf-8")
    (line,) = [line for line in text.splitlines() if line.startswith("x = ")]
    assert "FILL IN" in line
    assert '"Weg 1", "Weg 2"' in line
    with pytest.raises(InputError, match="no column 'FILL IN' for signal 'x'"):
        read_campaign(tmp_path)
    draft.path.write_text(text.replace('x = "FILL IN"', 'x = "Weg 2"'), encoding="utf-8")
    np.testing.assert_array_equal(read_campaign(tmp_path).records[0]["x"], 2 * ANSWER)


def test_a_file_without_time_leaves_the_sample_time_open(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"u": SWEEP, "x": ANSWER})
    draft = run_init(tmp_path)
    text = draft.path.read_text(encoding="utf-8")
    assert 'dt = "FILL IN"' in text
    draft.path.write_text(text.replace('dt = "FILL IN"', "dt = 0.01"), encoding="utf-8")
    assert read_campaign(tmp_path).records[0].dt == 0.01


def test_different_rates_are_written_out(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("log", "u", SWEEP[::2], properties={"wf_increment": 0.02}),
        nptdms.ChannelObject("log", "x", ANSWER, properties={"wf_increment": 0.01}),
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(channels)
    run_init(tmp_path)
    (record,) = read_campaign(tmp_path).records
    assert record.dt == 0.01
    assert "every 0.02 s" in record.notes[0]


def test_a_first_column_that_only_rises_is_proposed_as_time(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "a.mat", {"data": np.column_stack([T, ANSWER]), "u": SWEEP})
    run_init(tmp_path, model="axis")
    (record,) = read_campaign(tmp_path).records
    assert record.dt == pytest.approx(T[1] - T[0])
    np.testing.assert_array_equal(record["u"], SWEEP)
    np.testing.assert_array_equal(record["x"], ANSWER)


def test_a_log_of_a_robot_is_read_from_json(tmp_path: Path) -> None:
    columns = {"time": T, "a1 torque cmd [Nm]": SWEEP, "a1 angle [rad]": ANSWER, "a1 velocity": SWEEP**2}
    rows = [
        dict(zip(columns, row, strict=True))
        for row in zip(*(c.tolist() for c in columns.values()), strict=True)
    ]
    (tmp_path / "a.json").write_text(json.dumps(rows), encoding="utf-8")
    run_init(tmp_path, model="axis")
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["u"], SWEEP)
    np.testing.assert_allclose(record["x"], ANSWER)


@pytest.mark.slow
def test_units_that_the_file_states_need_no_mapping(tmp_path: Path) -> None:
    write_mdf(tmp_path / "a.mf4", {"t": T, "u": SWEEP, "x": 1e3 * ANSWER}, {"u": "N", "x": "mm"})
    draft = run_init(tmp_path)
    table = tomllib.loads(draft.path.read_text(encoding="utf-8"))["records"][0]
    assert table["columns"] == {"u": "u"}
    np.testing.assert_allclose(read_campaign(tmp_path).records[0]["x"], ANSWER, rtol=1e-14)


def test_what_is_no_record_is_left_out_with_its_reason(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "x": ANSWER}, {})
    (tmp_path / "notes.txt").write_text("measured on a Monday\nby hand\n")
    (tmp_path / "broken.mat").write_bytes(b"no")
    (tmp_path / "picture.png").write_bytes(b"no")
    draft = run_init(tmp_path)
    assert draft.records == ("a.csv",)
    assert [name for name, _ in draft.left_out] == ["broken.mat", "notes.txt"]
    assert "# broken.mat: " in draft.path.read_text(encoding="utf-8")
    read_campaign(tmp_path)


def test_a_campaign_is_never_overwritten(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "x": ANSWER}, {})
    (tmp_path / "campaign.toml").write_text("mine")
    with pytest.raises(InputError, match="not overwritten"):
        run_init(tmp_path)
    assert (tmp_path / "campaign.toml").read_text() == "mine"


def test_nothing_is_written_where_there_is_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no usable measured file"):
        run_init(tmp_path)
    (tmp_path / "broken.mat").write_bytes(b"no")
    with pytest.raises(InputError, match=r"broken.mat: is no MATLAB file"):
        run_init(tmp_path)
    with pytest.raises(InputError, match="is not a folder"):
        run_init(tmp_path / "nowhere")
    assert [path.name for path in tmp_path.iterdir()] == ["broken.mat"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ['qu"ote.csv', "back\\slash.csv", "zeile\nzwei.csv", "ünï # hash.csv"])
def test_odd_file_and_channel_names_are_written_as_they_are(tmp_path: Path, name: str) -> None:
    good = tmp_path / "good.parquet"
    write_parquet(good, {"t": T, "u": SWEEP, 'Weg "\\" [mm]': 1e3 * ANSWER}, {})
    shutil.move(good, tmp_path / name)
    run_init(tmp_path)
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["x"], ANSWER, rtol=1e-12)


@pytest.mark.parametrize("name", ["ref", "setpoint", "goal", "reference"])
def test_a_column_called_like_a_reference_is_proposed_as_one(tmp_path: Path, name: str) -> None:
    write_text(tmp_path / "run.csv", {"t": T, "u": SWEEP, name: 0.5 * ANSWER, "x": ANSWER}, {})
    assert run_init(tmp_path).model == "axis"
    (record,) = read_campaign(tmp_path).records
    np.testing.assert_allclose(record["reference"], 0.5 * ANSWER)


def test_what_a_rig_calls_so_itself_is_no_reference_beside_it(tmp_path: Path) -> None:
    write_text(tmp_path / "run.csv", {"t": T, "goal": SWEEP, "angle": ANSWER}, {})
    assert run_init(tmp_path).model == "servo"
    assert "reference" not in (tmp_path / "campaign.toml").read_text(encoding="utf-8")


def test_files_of_labview_are_found_and_their_time_is_known(tmp_path: Path) -> None:
    rows = "\n".join(f"{t:.3f}\t{u:.6f}\t{x:.6f}" for t, u, x in zip(T, SWEEP, ANSWER, strict=True))
    (tmp_path / "a.lvm").write_text(f"X_Value\tu\tx\tComment\n{rows}\n")
    assert run_init(tmp_path).n_blanks == 0
    assert read_campaign(tmp_path).records[0].dt == 0.01


def test_every_candidate_is_listed(tmp_path: Path) -> None:
    extra = {f"Weg {i}": (i + 1) * ANSWER for i in range(30)}
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, **extra}, {})
    text = run_init(tmp_path, model="axis").path.read_text(encoding="utf-8")
    assert all(f'"{name}"' in text for name in extra)


def test_constants_beside_the_signals_are_no_candidates(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"t": T, "u": SWEEP, "a1": T, "a2": ANSWER, "feedback": np.arange(4.0)})
    text = run_init(tmp_path, model="axis").path.read_text(encoding="utf-8")
    assert 'one of: "a1", "a2"' in text
    assert "feedback" not in text


def test_x_and_y_of_a_regression_are_asked_about(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "X": SWEEP, "y": ANSWER}, {})
    entry = tomllib.loads(run_init(tmp_path, model="axis").path.read_text(encoding="utf-8"))["records"][0]
    assert entry["columns"] == {"u": "FILL IN", "x": "FILL IN"}


def test_a_time_that_does_not_increase_is_not_proposed(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": np.floor(10.0 * T), "u": SWEEP, "x": ANSWER}, {})
    entry = tomllib.loads(run_init(tmp_path).path.read_text(encoding="utf-8"))["records"][0]
    assert entry["dt"] == "FILL IN"


def test_a_row_of_units_needs_no_mapping(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": 1e3 * T, "u": SWEEP, "x": 1e3 * ANSWER}, {})
    path = tmp_path / "a.csv"
    path.write_text(path.read_text().replace("t,u,x\n", "t,u,x\nms,N,mm\n"))
    run_init(tmp_path)
    record = read_campaign(tmp_path).records[0]
    assert record.dt == pytest.approx(0.01)
    np.testing.assert_allclose(record["x"], ANSWER, rtol=1e-12, atol=1e-15)


def test_the_gain_of_an_input_in_another_unit_is_asked_about(tmp_path: Path) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": SWEEP, "x": ANSWER}, {})
    path = tmp_path / "a.csv"
    path.write_text(path.read_text().replace("t,u,x\n", "t,u,x\ns,kN,m\n"))
    (tmp_path / "campaign.toml").write_text(
        '[rig]\nmodel = "axis"\n[rig.constants]\ngain = 2.0\n[[records]]\nfile = "a.csv"\n'
    )
    with pytest.raises(InputError, match=r"'u': is in kN.*gain counts per N"):
        read_campaign(tmp_path)
    with (tmp_path / "campaign.toml").open("a") as file:
        file.write('columns = { u = { name = "u", unit = "kN", unwrap = false } }\n')
    np.testing.assert_allclose(read_campaign(tmp_path).records[0]["u"], 1e3 * SWEEP, rtol=1e-12)


@pytest.mark.parametrize(
    ("drive", "hold"), [(SWEEP, "foh"), (0.5 * np.sign(SWEEP), "zoh"), (np.round(SWEEP, 2), "foh")]
)
def test_an_input_that_stays_and_jumps_is_held(tmp_path: Path, drive: np.ndarray, hold: str) -> None:
    write_text(tmp_path / "a.csv", {"t": T, "u": drive, "x": ANSWER}, {})
    assert f'hold = "{hold}"' in run_init(tmp_path).path.read_text("utf-8")
