"""What ``rigsight inspect`` and ``rigsight init`` tell."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from rigsight.records import ColumnMapping
from rigsight.records.channel_table import read_columns
from rigsight.records.formats.channel import Channel, ChannelFile
from rigsight.records.formats.known import FORMATS as KNOWN
from rigsight.rigs import RIGS

from ..records.formats.files import FORMATS, Write, write_matlab, write_tdms, write_text, write_ulog

Run = Callable[..., tuple[int, str, str]]
T = 0.01 * np.arange(300)
ROWS = {"t": T, "u": np.sin(9 * T**2), "x": 0.01 * np.cos(9 * T**2)}


@pytest.mark.slow
@pytest.mark.parametrize(("suffix", "write"), FORMATS.values(), ids=FORMATS)
def test_every_format_is_told_to_people_and_machines(
    tmp_path: Path, run: Run, suffix: str, write: Write
) -> None:
    path = tmp_path / f"run{suffix}"
    write(path, ROWS, {"u": "N", "x": "m"})
    code, stdout, stderr = run("inspect", path, "--json")
    assert (code, stderr) == (0, "")
    reported = json.loads(stdout)
    channels = {one["name"].rpartition("/")[2]: one for one in reported["channels"]}
    assert channels["x"]["n_samples"] == 300
    assert channels["x"]["minimum"] == pytest.approx(-0.01, rel=1e-3)
    assert channels["x"]["unit"] in ("m", None)
    assert channels["x"]["n_not_finite"] == 0
    (record,) = tomllib.loads(reported["proposal"]["toml"])["records"]
    assert record["file"] == path.name
    assert reported["proposal"]["model"] == "axis"


def test_text_is_inspected_with_its_gaps(tmp_path: Path, run: Run) -> None:
    path = tmp_path / "run.csv"
    write_text(path, {"Zeit [ms]": 1e3 * np.delete(T, 100), "u": ROWS["u"][1:], "Weg mm": ROWS["x"][1:]}, {})
    lines = path.read_text().splitlines()
    lines[5] = lines[5].rpartition(",")[0] + ",NaN"
    path.write_text("\n".join(lines) + "\n")
    code, stdout, _ = run("inspect", path)
    assert code == 0
    for part in ("run.csv", "Weg mm", "299", "step 10, 1 gaps", 'unit = "ms"', 'unit = "mm"', "[[records]]"):
        assert part in stdout
    reported = json.loads(run("inspect", path, "--json")[1])
    assert [one["n_not_finite"] for one in reported["channels"]] == [0, 0, 1]


@pytest.mark.parametrize("header", ["t,u,x,x", "t,,u,", "t,control[0],control[1],pos [m]", "t,u,2,x"])
def test_channels_are_listed_by_names_that_a_campaign_takes(tmp_path: Path, run: Run, header: str) -> None:
    file = tmp_path / "run.csv"
    rows = np.column_stack([T, np.sin(T), np.cos(T), T**2])
    np.savetxt(file, rows, delimiter=",", header=header, comments="")
    code, stdout, stderr = run("inspect", file, "--json")
    assert code == 0, stderr
    names = [channel["name"] for channel in json.loads(stdout)["channels"]]
    for column, name in enumerate(names):
        columns = {"t": ColumnMapping(1), "x": ColumnMapping(name)}
        read = read_columns(file, columns, time_is_mapped=True)
        np.testing.assert_allclose(read.values["x"], rows[:, column])
    assert len(set(names)) == 4


def test_times_that_are_no_numbers_are_left_out(tmp_path: Path, run: Run) -> None:
    write_tdms(tmp_path / "run.tdms", {**ROWS, "t": np.where(T == 0.0, np.nan, T)}, {})
    code, stdout, _ = run("inspect", tmp_path / "run.tdms", "--json")
    assert code == 0
    (u, _) = json.loads(stdout)["channels"]
    assert (u["dt"], u["t0"], u["t1"], u["n_gaps"]) == (None, None, None, None)


def test_one_channel_that_cannot_be_read_does_not_spoil_the_others(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(_: Path) -> Iterator[ChannelFile]:
        good = [Channel(name, 300, lambda own=own: own) for name, own in ROWS.items()]
        yield ChannelFile((*good, Channel("oil", 300, lambda: np.zeros(7))))

    write_tdms(tmp_path / "run.tdms", ROWS, {})
    monkeypatch.setattr("rigsight.records.formats.read_tdms.open_tdms", opened)
    code, stdout, _ = run("inspect", tmp_path / "run.tdms", "--json")
    reported = json.loads(stdout)
    assert (code, [one["name"] for one in reported["channels"]]) == (0, list(ROWS))
    (refused,) = reported["refused"]
    assert (refused["name"], "7 of 300" in refused["reason"]) == ("oil", True)


def test_what_a_channel_does_not_show_is_told(tmp_path: Path, run: Run) -> None:
    held = ROWS["x"][np.arange(300) // 5 * 5]
    coded, angle = ROWS["x"].copy(), np.mod(40.0 * ROWS["x"] * 50.0, 360.0)
    coded[7] = -9999.0
    write_text(tmp_path / "run.csv", {**ROWS, "held": held, "coded": coded, "angle": angle}, {})
    reported = {
        one["name"]: one["remarks"]
        for one in json.loads(run("inspect", tmp_path / "run.csv", "--json")[1])["channels"]
    }
    assert [name for name, remarks in reported.items() if remarks] == ["held", "coded", "angle"]
    for name, part in (("held", "every 5 rows"), ("coded", "-9999"), ("angle", "360")):
        assert part in reported[name][0]


def test_what_is_no_signal_is_told(tmp_path: Path, run: Run) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {**ROWS, "fs": 100.0, "note": "bench"})
    _, stdout, _ = run("inspect", tmp_path / "run.mat")
    assert "'fs' holds a single number" in stdout
    assert "'note' is text" in stdout


def test_a_log_that_is_cut_short_says_so(tmp_path: Path, run: Run) -> None:
    pytest.importorskip("pyulog")
    write_ulog(tmp_path / "run.ulg", ROWS, {})
    assert json.loads(run("inspect", tmp_path / "run.ulg", "--json")[1])["notes"] == []
    log = bytearray((tmp_path / "run.ulg").read_bytes())
    log[4000:4200] = bytes(200)
    (tmp_path / "run.ulg").write_bytes(log)
    assert "run.ulg: the log is cut short or damaged" in run("inspect", tmp_path / "run.ulg")[1]


@pytest.mark.parametrize("content", [b"", b"nothing", bytes(100)])
def test_what_cannot_be_read_is_one_message(tmp_path: Path, run: Run, content: bytes) -> None:
    (tmp_path / "run.mat").write_bytes(content)
    code, stdout, stderr = run("inspect", tmp_path / "run.mat")
    assert (code, stdout) == (2, "")
    assert stderr.startswith("rigsight: run.mat ")
    assert stderr.count("\n") == 1


def test_quiet_says_nothing(tmp_path: Path, run: Run) -> None:
    write_matlab(tmp_path / "run.mat", ROWS, {})
    assert run("inspect", tmp_path / "run.mat", "--quiet") == (0, "", "")
    assert run("init", tmp_path, "--quiet") == (0, "", "")
    assert (tmp_path / "campaign.toml").is_file()


def test_init_tells_what_is_left_to_do(tmp_path: Path, run: Run) -> None:
    write_text(tmp_path / "run.csv", {"t": T, "u": ROWS["u"], "psi": ROWS["x"]}, {})
    code, stdout, stderr = run("init", tmp_path)
    assert (code, stderr) == (0, "Reading files ...\n")
    assert "running_gear, 1 record)" in stdout
    assert '"FILL IN" (4 times)' in stdout
    code, _, stderr = run("init", tmp_path)
    assert code == 2
    assert "not overwritten" in stderr


def test_init_says_that_the_rig_is_a_guess_unless_it_was_told(tmp_path: Path, run: Run) -> None:
    write_text(tmp_path / "run.csv", ROWS, {})
    assert "The rig was guessed from the channels" in run("init", tmp_path)[1]
    (tmp_path / "campaign.toml").unlink()
    assert "guess" not in run("init", tmp_path, "--model", "axis")[1]


def test_an_unknown_rig_is_told(tmp_path: Path, run: Run) -> None:
    write_matlab(tmp_path / "run.mat", ROWS, {})
    code, _, stderr = run("init", tmp_path, "--model", "bicycle")
    assert code == 2
    assert all(f"'{rig}'" in stderr for rig in RIGS)


def test_the_help_names_every_format(run: Run) -> None:
    """It is written out there: to import the table of formats would make all help slow."""
    shown = " ".join(run("inspect", "--help")[1].split())
    assert [known.name for known in KNOWN if known.suffixes and known.name not in shown] == []


def test_channels_are_plotted_over_the_time_of_the_file(
    run: Run, write_csv: Callable[..., Path], tmp_path: Path
) -> None:
    picture = tmp_path / "plots" / "sweep.svg"
    code, out, _ = run("inspect", write_csv(), "--picture", picture, "--json")
    assert (code, len(json.loads(out)["channels"])) == (0, 4)
    drawn = picture.read_text(encoding="utf-8")
    assert [name for name in ("t", "u", "psi", "y") if f">{name}</text>" in drawn] == ["t", "u", "psi", "y"]
    assert drawn.count(">t</text>") == 1
    code, _, err = run("inspect", write_csv(), "--picture", tmp_path / "sweep.pdf")
    assert code == 2
    assert ".svg" in err
