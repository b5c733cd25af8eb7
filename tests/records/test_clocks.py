"""Which time belongs to which signal, by names, groups, order, declaration or file, in every format."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, Record, read_record
from rigsight.records.clocks import own_clocks
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.init import run_init

from .test_resampling import Named

DT, LATE = 0.01, 0.0173
DRIVE = DT * np.arange(300)
STAGE = DT * np.arange(320) + LATE


def force(t: np.ndarray) -> np.ndarray:
    return np.sin(5.0 * t)


def position(t: np.ndarray) -> np.ndarray:
    return np.cos(3.0 * t)


def write_csv(path: Path, head: str = "Time Force;Force;Time Pos;Pos") -> None:
    """Columns of which those of the drive end earlier."""
    rows = [head]
    for i, t in enumerate(STAGE):
        left = f"{DRIVE[i]:.4f};{force(DRIVE[i]):.9f}" if i < DRIVE.size else ";"
        rows.append(f"{left};{t:.4f};{position(t):.9f}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def write_csv_in_order(path: Path) -> None:
    write_csv(path, "Time;Force;Time;Pos")


def write_tdms_dates(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2024-03-01T12:00:00", "us")
    channels = []
    for group, name, t, samples in (
        ("AO", "Force", DRIVE, force(DRIVE)),
        ("AI", "Pos", STAGE, position(STAGE)),
    ):
        dates = start + np.round(1e6 * t).astype("timedelta64[us]")
        channels += [nptdms.ChannelObject(group, "Time", dates), nptdms.ChannelObject(group, name, samples)]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def write_tdms_waveforms(path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2024-03-01T12:00:00", "us")
    channels = [
        nptdms.ChannelObject(
            group,
            name,
            samples,
            properties={"wf_increment": DT, "wf_start_time": start + np.timedelta64(round(1e6 * t[0]), "us")},
        )
        for group, name, t, samples in (
            ("AO", "Force", DRIVE, force(DRIVE)),
            ("AI", "Pos", STAGE, position(STAGE)),
        )
    ]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def write_scopes(path: Path) -> None:
    from scipy.io import savemat

    savemat(
        path,
        {
            "ScopeF": {"time": DRIVE, "signals": {"Force": force(DRIVE)}},
            "ScopeX": {"time": STAGE, "signals": {"Pos": position(STAGE)}},
        },
    )


def write_hdf5(path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for group, name, t, samples in (
            ("a", "Force", DRIVE, force(DRIVE)),
            ("b", "Pos", STAGE, position(STAGE)),
        ):
            file[f"{group}/time"], file[f"{group}/{name}"] = t, samples


def write_mdf(path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(force(DRIVE), DRIVE, name="Force")])
        file.append([asammdf.Signal(position(STAGE), STAGE, name="Pos")])
        file.save(path, overwrite=True)


def write_parquet_dates(path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    start, n = np.datetime64("2024-03-01T12:00:00", "ns"), DRIVE.size
    columns = {
        "time Force": start + np.round(1e9 * DRIVE).astype("timedelta64[ns]"),
        "Force": force(DRIVE),
        "time Pos": start + np.round(1e9 * STAGE[:n]).astype("timedelta64[ns]"),
        "Pos": position(STAGE[:n]),
    }
    parquet.write_table(arrow.table(columns), path)


WRITERS: dict[str, tuple[str, Callable[[Path], None]]] = {
    "text, by name": ("a.csv", write_csv),
    "text, by order": ("a.csv", write_csv_in_order),
    "TDMS dates": ("a.tdms", write_tdms_dates),
    "TDMS waveforms": ("a.tdms", write_tdms_waveforms),
    "MATLAB scopes": ("a.mat", write_scopes),
    "HDF5 groups": ("a.h5", write_hdf5),
    "MDF groups": ("a.mf4", write_mdf),
    "Parquet dates": ("a.parquet", write_parquet_dates),
}


def read(path: Path, columns: dict[str, ColumnMapping | str | int], **options: object) -> Record:
    options = {"hold": "band_limited", **options}
    return read_record(
        path, (Named("u", "input"),), (Named("x", "m"),), ReadingOptions(columns=columns, **options)
    )


def check_times(record: Record, late: float = 0.0) -> None:
    inner = slice(3, -3)
    np.testing.assert_allclose(record["u"][inner], force(record.t - late)[inner], atol=2e-5)
    np.testing.assert_allclose(record["x"][inner], position(record.t - late)[inner], atol=2e-5)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_each_signal_goes_by_its_own_clock(tmp_path: Path, name: str) -> None:
    file, write = WRITERS[name]
    write(tmp_path / file)
    names = {"MATLAB scopes": ("ScopeF/signals/Force", "ScopeX/signals/Pos")}.get(name, ("Force", "Pos"))
    record = read(tmp_path / file, {"u": names[0], "x": names[1]})
    check_times(record)
    assert record.n_samples >= 270
    assert record.clock_uncertainty == pytest.approx(DT)
    assert "clocks of their own" in record.notes[0]


@pytest.mark.parametrize(
    ("head", "drive", "stage"),
    [("time;u;time;x", "1", "3"), ("t_cmd;u;t_stage;x", "t_cmd", "t_stage"), ("note;t_cmd;u;t_x;x", "t_cmd", "t_x"),
     ("note;time;u;time;x", "2", "4")],
)  # fmt: skip
def test_init_names_times_as_reading_finds_them(tmp_path: Path, head: str, drive: str, stage: str) -> None:
    write_csv(tmp_path / "run.csv", head.removeprefix("note;"))
    if head.startswith("note"):
        first, *rows = (tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
        text = "\n".join([f"note;{first}", *(f"as planned;{row}" for row in rows)])
        (tmp_path / "run.csv").write_text(text + "\n", encoding="utf-8")
    path = run_init(tmp_path, model="axis").path
    text = path.read_text(encoding="utf-8")
    assert f'time = "{drive}"' in text
    assert f'time = "{stage}"' in text
    path.write_text(text.replace('hold = "foh"', 'hold = "band_limited"'), encoding="utf-8")
    check_times(read_campaign(tmp_path).records[0])


def test_what_only_begins_like_a_time_is_none(tmp_path: Path) -> None:
    rows = "".join(f"{t:.2f};{np.sin(t):.5f};{20.0 + np.cos(t):.5f};{np.cos(t):.5f}\n" for t in DRIVE)
    (tmp_path / "run.csv").write_text("t_log;u;t_oil;x\n" + rows, encoding="utf-8")
    assert "time = " not in run_init(tmp_path, model="axis").path.read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in WRITERS if name != "MDF groups"])
def test_init_proposes_what_can_be_read(tmp_path: Path, name: str) -> None:
    file, write = WRITERS[name]
    write(tmp_path / file)
    draft = run_init(tmp_path, model="axis")
    text = draft.path.read_text(encoding="utf-8")
    text = text.replace('u = "FILL IN"', 'u = "Force"').replace('hold = "foh"', 'hold = "band_limited"')
    draft.path.write_text(text, encoding="utf-8")
    check_times(read_campaign(tmp_path).records[0])


@pytest.mark.parametrize("declared", ["Time Force", "Time Pos"])
def test_one_time_declared_for_all_does_not_shift_the_others(tmp_path: Path, declared: str) -> None:
    write_csv(tmp_path / "a.csv")
    record = read(tmp_path / "a.csv", {"t": declared, "u": "Force", "x": "Pos"})
    check_times(record)
    assert "Time Force" in record.notes[0]
    assert "Time Pos" in record.notes[0]


def test_the_time_of_a_signal_can_be_declared(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", "clock 1;Force;clock 2;Pos")
    columns = {"u": ColumnMapping("Force", time="clock 1"), "x": ColumnMapping("Pos", time=3)}
    check_times(read(tmp_path / "a.csv", columns))


def test_a_campaign_declares_times_and_files_of_signals(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "f.csv", np.c_[DRIVE, force(DRIVE)], "%.9g", ",", header="s,Force", comments="")
    np.savetxt(tmp_path / "x.csv", np.c_[STAGE, position(STAGE)], "%.9g", ",", header="t,Pos", comments="")
    campaign = tmp_path / "campaign.toml"
    text = """title = "two files"
[rig]
model = "axis"
[[records]]
file = "x.csv"
hold = "band_limited"
start = 1.0
end = 2.5
[records.columns]
u = { file = "f.csv", name = "Force", time = "s" }
x = "Pos"
"""
    campaign.write_text(text, encoding="utf-8")
    (record,) = read_campaign(tmp_path).records
    check_times(record)
    assert record.t[0] == pytest.approx(1.0, abs=1.5 * DT)
    assert record.t[-1] == pytest.approx(2.5, abs=1.5 * DT)
    campaign.write_text(text.replace("f.csv", "missing.csv"), encoding="utf-8")
    with pytest.raises(InputError, match=r"columns.u.file.*missing.csv.* does not exist"):
        read_campaign(tmp_path)


def test_dated_files_are_joined_by_their_dates(tmp_path: Path) -> None:
    write_tdms_waveforms(tmp_path / "a.tdms")
    write_tdms_dates(tmp_path / "b.tdms")
    columns = {"u": ColumnMapping("Force", file=tmp_path / "b.tdms"), "x": "Pos"}
    record = read(tmp_path / "a.tdms", columns)
    # Times count from the first sample of the drive in b, and of the drive in a: the same moment.
    check_times(record)


def test_clocks_that_cannot_be_compared_are_refused(tmp_path: Path) -> None:
    write_tdms_waveforms(tmp_path / "a.tdms")
    np.savetxt(tmp_path / "f.csv", np.c_[DRIVE, force(DRIVE)], "%.9g", ",", header="t,Force", comments="")
    columns = {"u": ColumnMapping("Force", file=tmp_path / "f.csv"), "x": "Pos"}
    with pytest.raises(InputError, match="cannot be compared"):
        read(tmp_path / "a.tdms", columns)


def test_one_sample_time_is_refused_for_clocks_that_differ(tmp_path: Path) -> None:
    write_tdms_dates(tmp_path / "a.tdms")
    with pytest.raises(InputError, match=r"dt = 0.01 cannot hold"):
        read(tmp_path / "a.tdms", {"u": "Force", "x": "Pos"}, dt=0.01)


def test_one_sample_time_is_refused_for_columns_of_several_clocks(tmp_path: Path) -> None:
    rows = [f"{t},{force(t)},{t},{position(t)}" for t in DRIVE]
    (tmp_path / "a.csv").write_text("\n".join(["Time,Force,Time,Pos", *rows]), encoding="utf-8")
    with pytest.raises(InputError, match=r"dt = 0.01 cannot hold"):
        read(tmp_path / "a.csv", {"u": "Force", "x": "Pos"}, dt=0.01)
    with pytest.raises(InputError, match=r"names a time of its own"):
        read(tmp_path / "a.csv", {"u": ColumnMapping("Force", time=1), "x": "Pos"}, dt=0.01)


def test_columns_of_time_with_one_name_and_a_unit_are_clocks_of_their_own(tmp_path: Path) -> None:
    rows = [f"{t},{force(t)},{t + 0.003},{position(t)}" for t in DRIVE]
    header = "Time [s],Force [N],Time [s],Pos [m]"
    (tmp_path / "a.csv").write_text("\n".join([header, *rows]), encoding="utf-8")
    record = read(tmp_path / "a.csv", {"u": "Force [N]", "x": "Pos [m]"})
    assert "'Time [s]'" in " ".join(record.notes)
    assert "'Time [s]_2'" in " ".join(record.notes)


def test_a_waveform_without_a_start_beside_one_with_it_is_refused(tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    start = {"wf_start_time": np.datetime64("2024-03-01T12:00:00", "us")}
    channels = [
        nptdms.ChannelObject("log", "u", force(DRIVE), properties={"wf_increment": DT}),
        nptdms.ChannelObject("log", "x", position(DRIVE), properties={"wf_increment": DT, **start}),
    ]
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as file:
        file.write_segment(channels)
    with pytest.raises(InputError, match="cannot be compared"):
        read(tmp_path / "a.tdms", {})


@pytest.mark.parametrize(
    ("names", "clocks"),
    [
        (["t", "u", "x"], {}),
        (["time", "timestamp", "u", "x"], {}),
        (["Time", "a", "b", "Time_2", "c"], {1: 0, 2: 0, 4: 3}),
        (["t_u", "u", "t_x", "x"], {1: 0, 3: 2}),
        (["x [mm]", "Zeit x [s]", "u", "u time"], {0: 1, 2: 3}),
        (["t", "log/time", "log/x", "u"], {2: 1, 3: 0}),
        (["a/time", "a/signals(1)/values", "b/time", "b/c/d"], {1: 0, 3: 2}),
    ],
)
def test_whose_time_is_whose(names: list[str], clocks: dict[int, int]) -> None:
    assert own_clocks(names) == clocks


CASES = Path(__file__).parents[3] / "shared" / "cases"


@pytest.mark.skipif(not CASES.is_dir(), reason="the reported inputs are not here")
@pytest.mark.parametrize(
    ("case", "late"),
    [
        ("tdms_two_start_times", 10),
        ("tdms_two_stamp_channels", 10),
        ("matlab_two_scopes", -10),
        ("csv_two_time_columns", -15),
    ],
)
def test_reported_files_are_joined_by_their_clocks(case: str, late: int) -> None:
    """Both signals are as the file holds them, shifted against each other by the offset of their clocks."""
    from rigsight.records.channel_table import open_measurement

    record = read_campaign(CASES / case).records[0]
    with open_measurement(record.source) as file:
        loaded = {channel.name.rpartition("/")[2]: channel.load() for channel in file.channels}
        u = loaded.get("force", loaded.get("Force"))
        if u is None:
            u, x = (channel.load() for channel in file.channels if channel.name.endswith("values"))
        else:
            x = loaded.get("pos", loaded.get("Pos"))
    first_u, first_x = max(0, -late), max(0, late)
    np.testing.assert_array_equal(record["u"], np.ravel(u)[first_u:][: record.n_samples])
    np.testing.assert_array_equal(record["x"], np.ravel(x)[first_x:][: record.n_samples])
