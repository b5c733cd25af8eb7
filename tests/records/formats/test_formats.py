"""The same record in every format, and what a file has to say about its channels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, read_record
from rigsight.records.formats.channel_file import open_channels
from rigsight.records.formats.known import BY_SUFFIX

from .channels_of_formats import OUTPUTS, Named, formats, read
from .files import (
    UNITS,
    Write,
    rows,
    write_hdf5,
    write_matlab,
    write_matlab_hdf5,
    write_mdf,
    write_parquet,
    write_tdms,
    write_text,
    write_uff,
)


@formats
def test_the_same_record_in_any_format(tmp_path: Path, suffix: str, write: Write) -> None:
    write_text(tmp_path / "run.csv", rows(), {})
    write(tmp_path / f"run{suffix}", rows(), UNITS)
    text, other = read(tmp_path / "run.csv"), read(tmp_path / f"run{suffix}")
    assert (other.name, other.dt, other.t0, other.notes) == ("run", text.dt, text.t0, ())
    assert dict(other.units) == dict(text.units)
    for signal in ("u", "psi", "y"):
        np.testing.assert_array_equal(other[signal], text[signal], strict=True)


@pytest.mark.slow
@formats
def test_single_precision_is_kept_and_its_time_meant_as_decimals(
    tmp_path: Path, suffix: str, write: Write
) -> None:
    single = {name: samples.astype(np.float32) for name, samples in rows().items()}
    path = tmp_path / f"run{suffix}"
    write(path, single, {})
    record = read(path)
    np.testing.assert_array_equal(record["psi"], single["psi"].astype(np.float64))
    assert record.dt == pytest.approx(0.01, rel=1e-6)
    assert record.notes == ()


@pytest.mark.slow
@formats
def test_content_decides_and_not_the_name(tmp_path: Path, suffix: str, write: Write) -> None:
    write(tmp_path / f"run{suffix}", rows(), {})
    path = (tmp_path / f"run{suffix}").rename(tmp_path / "run.csv")
    if suffix in (".bag", ".db3", ".mcap"):
        with pytest.raises(InputError, match="rename it"):
            read(path)
        return
    np.testing.assert_array_equal(read(path)["psi"], rows()["psi"])


@pytest.mark.parametrize("suffix", BY_SUFFIX)
@pytest.mark.parametrize("content", [b"", b"t,u,psi\n0,1,2\n", bytes(300)])
def test_a_name_that_promises_what_the_content_is_not(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"run{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"run{suffix} is (no .* file inside|empty)"):
        read(path)


@pytest.mark.slow
@pytest.mark.parametrize("write", [write_hdf5, write_mdf, write_tdms, write_parquet, write_uff])
def test_units_that_the_file_states_are_converted_and_told(tmp_path: Path, write: Write) -> None:
    path = tmp_path / "run"
    scaled = rows() | {"u": rows()["u"] * 1e3, "psi": np.degrees(rows()["psi"])}
    write(path, scaled, {"u": "mA", "psi": "deg", "y": "m"})
    record = read(path)
    np.testing.assert_allclose(record["u"], rows()["u"], rtol=1e-14)
    np.testing.assert_allclose(record["psi"], rows()["psi"], rtol=1e-14)
    assert sum("converted from" in note for note in record.notes) == 2
    assert any("mA" in note and "'" in note for note in record.notes)


@pytest.mark.slow
def test_scale_wins_over_the_unit_of_the_file(tmp_path: Path) -> None:
    write_parquet(tmp_path / "run", rows(), {"u": "mA"})
    record = read(tmp_path / "run", columns={"u": ColumnMapping("u", scale=2.0)})
    np.testing.assert_array_equal(record["u"], 2.0 * rows()["u"])
    assert record.notes == ()


@pytest.mark.slow
def test_a_unit_of_the_campaign_wins_over_that_of_the_file(tmp_path: Path) -> None:
    write_parquet(tmp_path / "run", rows(), {"u": "kA"})
    record = read(tmp_path / "run", columns={"u": ColumnMapping("u", unit="mA")})
    np.testing.assert_allclose(record["u"], 1e-3 * rows()["u"], rtol=1e-14)


@pytest.mark.parametrize("stated", ["s,mA,deg,mm", "[s],[mA],[deg],[mm]", "s;mA;deg;mm"])
def test_a_row_of_units_below_the_names_is_converted_and_told(tmp_path: Path, stated: str) -> None:
    path = tmp_path / "run.csv"
    write_text(path, rows(), {})
    text = path.read_text().replace("t,u,psi,y\n", f"t,u,psi,y\n{stated.replace(';', ',')}\n")
    path.write_text(text.replace(",", ";") if ";" in stated else text)
    record = read(path)
    for signal, scale in (("u", 1e-3), ("psi", np.pi / 180.0), ("y", 1e-3)):
        np.testing.assert_allclose(record[signal], scale * rows()[signal], rtol=1e-14)
        assert any(f"column '{signal}': converted" in note for note in record.notes)
    asked = read(path, columns={"u": ColumnMapping("u", scale=1.0), "y": ColumnMapping("y", unit="m")})
    np.testing.assert_array_equal(asked["u"], rows()["u"])
    np.testing.assert_array_equal(asked["y"], rows()["y"])


def test_a_row_of_units_counts_for_time(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_text(path, {**rows(), "t": 1e3 * rows()["t"]}, {})
    path.write_text(path.read_text().replace("t,u,psi,y\n", "t,u,psi,y\nms,A,rad,m\n"))
    assert read(path).dt == pytest.approx(0.01, rel=1e-12)


def test_a_unit_in_brackets_behind_the_name_is_converted_and_told(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    write_text(path, rows(), {})
    path.write_text(path.read_text().replace("t,u,psi,y\n", "t,u [mA],psi (deg),y_mm\n"))
    record = read(path, columns={"u": "u [mA]", "psi": "psi (deg)", "y": "y_mm"})
    np.testing.assert_allclose(record["u"], 1e-3 * rows()["u"], rtol=1e-14)
    np.testing.assert_allclose(record["psi"], np.radians(rows()["psi"]), rtol=1e-14)
    # A last word may be something else than a unit: asked about, not applied.
    np.testing.assert_array_equal(record["y"], rows()["y"])


@pytest.mark.slow
def test_a_unit_that_does_not_fit_is_told_with_the_mend(tmp_path: Path) -> None:
    write_parquet(tmp_path / "run.parquet", rows(), {"psi": "mm"})
    with pytest.raises(InputError) as caught:
        read(tmp_path / "run.parquet")
    for part in ("run.parquet", "'psi'", "'mm'", "rad", "scale = 1.0"):
        assert part in str(caught.value)


@pytest.mark.slow
def test_an_input_without_a_unit_of_its_own_is_converted_to_that_of_a_drive_and_told(tmp_path: Path) -> None:
    write_parquet(tmp_path / "run", rows(), {"u": "kN"})
    record = read_record(tmp_path / "run", (Named("u", "input"),), OUTPUTS)
    np.testing.assert_allclose(record["u"], 1e3 * rows()["u"], rtol=1e-14)
    assert "from kN" in record.notes[0]
    with pytest.raises(InputError, match="gain counts per N"):
        read_record(tmp_path / "run", (Named("u", "input"),), OUTPUTS, ReadingOptions(gain="gain"))
    write_parquet(tmp_path / "turns", rows(), {"u": "rpm"})
    record = read_record(tmp_path / "turns", (Named("u", "input"),), OUTPUTS)
    np.testing.assert_array_equal(record["u"], rows()["u"])
    assert "in rpm" in record.notes[0]
    columns = {"u": ColumnMapping("u", unit="kN")}
    asked = read_record(tmp_path / "run", (Named("u", "input"),), OUTPUTS, ReadingOptions(columns=columns))
    np.testing.assert_allclose(asked["u"], 1e3 * rows()["u"], rtol=1e-14)


ODD = {"Zeit [ms]": "t", "Strom (A)": "u", "Signal/Winkel °": "psi", "Weg, quer µm": "y"}


@pytest.mark.parametrize("write", [write_parquet, write_hdf5])
def test_odd_names(tmp_path: Path, write: Write) -> None:
    good = rows()
    odd = {name: good[signal] * (1e3 if signal == "t" else 1.0) for name, signal in ODD.items()}
    write(tmp_path / "run", odd, {})
    prefix = "run 1/" if write is write_hdf5 else ""
    columns = {signal: ColumnMapping(prefix + name) for name, signal in ODD.items()}
    columns["t"] = ColumnMapping(prefix + "Zeit [ms]", unit="ms")
    record = read(tmp_path / "run", columns=columns)
    assert record.dt == pytest.approx(0.01, rel=1e-12)
    np.testing.assert_array_equal(record["y"], good["y"])


@pytest.mark.slow
@pytest.mark.parametrize("packed", [False, True])
def test_structs_are_looked_into(tmp_path: Path, packed: bool) -> None:
    from scipy.io import savemat

    content = {
        "log": {**rows(), "info": "bench 3", "deep": {"er": {"x": rows()["u"]}}},
        "names": np.array(["a", "b"], dtype=object),
        "fs": 100.0,
    }
    savemat(tmp_path / "run.mat", content, do_compression=packed)
    np.testing.assert_array_equal(read(tmp_path / "run.mat")["psi"], rows()["psi"])
    with open_channels(tmp_path / "run.mat") as file:
        names = [channel.name for channel in file.channels]
        refused = {one.name: one.reason for one in file.refused}
    assert names == ["log/t", "log/u", "log/psi", "log/y", "log/deep/er/x"]
    assert "text" in refused["log/info"]
    assert "cell" in refused["names"]
    deep = read(tmp_path / "run.mat", columns={"psi": ColumnMapping("log/deep/er/x")})
    np.testing.assert_array_equal(deep["psi"], rows()["u"])
    with pytest.raises(InputError, match="'log/info', which signal 'u' is mapped to, is text"):
        read(tmp_path / "run.mat", columns={"u": ColumnMapping("log/info")})


def test_objects_and_sparse_matrices_of_a_7_3_file_are_no_signals(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    write_matlab_hdf5(tmp_path / "run.mat", rows(), {})
    with h5py.File(tmp_path / "run.mat", "r+") as file:
        for name, kind in (
            ("logsout", "Simulink.SimulationData.Dataset"),
            ("sparse", "double"),
            ("log", "struct"),
        ):
            file.create_group(name).attrs["MATLAB_class"] = np.bytes_(kind)
            file[name].create_dataset("data", data=rows()["u"][None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        file["stream"] = np.zeros((1, 120), dtype=np.uint8)
    with open_channels(tmp_path / "run.mat") as opened:
        assert {channel.name for channel in opened.channels} == {*rows(), "log/data"}
        assert {one.name for one in opened.refused} == {"logsout", "sparse", "stream"}


def test_structures_with_time_as_simulink_logs_them(tmp_path: Path) -> None:
    from scipy.io import savemat

    good = rows()
    signals = np.zeros((1, 3), dtype=[("values", object), ("label", object)])
    for place, name in enumerate(("u", "psi", "y")):
        signals[0, place] = (good[name][:, None], name)
    savemat(tmp_path / "run.mat", {"logsout": {"time": good["t"][:, None], "signals": signals}})
    columns = {
        "t": ColumnMapping("logsout/time"),
        **{
            name: ColumnMapping(f"logsout/signals({i})/values") for i, name in enumerate(("u", "psi", "y"), 1)
        },
    }
    record = read(tmp_path / "run.mat", columns=columns)
    for name in ("u", "psi", "y"):
        np.testing.assert_array_equal(record[name], good[name])


def test_a_group_inside_itself_ends(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    write_matlab_hdf5(tmp_path / "run.mat", rows(), {})
    with h5py.File(tmp_path / "run.mat", "r+") as file:
        group = file.create_group("log")
        group["again"] = group
        group.create_dataset("x", data=rows()["u"][None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with open_channels(tmp_path / "run.mat") as opened:
        names = [channel.name for channel in opened.channels]
        (refused,) = opened.refused
    assert {"t", "u", "psi", "y", "log/x", "log/again/x"} < set(names)
    assert "structs deep" in refused.reason


def test_columns_of_a_matrix(tmp_path: Path) -> None:
    from scipy.io import savemat

    savemat(tmp_path / "run.mat", {"data": np.column_stack(list(rows().values()))})
    columns = {signal: ColumnMapping(f"data(:,{i})") for i, signal in enumerate(rows(), 1)}
    np.testing.assert_array_equal(read(tmp_path / "run.mat", columns=columns)["y"], rows()["y"])
    by_number = {signal: ColumnMapping(i) for i, signal in enumerate(rows(), 1)}
    np.testing.assert_array_equal(read(tmp_path / "run.mat", columns=by_number)["y"], rows()["y"])


@pytest.mark.slow
def test_time_may_be_given_as_a_sample_time(tmp_path: Path) -> None:
    timeless = {name: samples for name, samples in rows().items() if name != "t"}
    write_matlab(tmp_path / "run.mat", timeless, {})
    write_text(tmp_path / "run.csv", timeless, {})
    with pytest.raises(InputError, match=r"dt = 0\.001"):
        read(tmp_path / "run.mat")
    for name in ("run.mat", "run.csv"):
        record = read(tmp_path / name, dt=0.01)
        assert (record.dt, record.t0, record.n_samples, record.notes) == (0.01, 0.0, 120, ())
    with pytest.raises(InputError, match="give one of the two"):
        read(tmp_path / "run.csv", dt=0.01, columns={"t": ColumnMapping("u")})


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["text", "matlab", "mdf"])
def test_a_sample_time_beside_the_time_of_a_file_is_told(tmp_path: Path, kind: str) -> None:
    suffix, write = {
        "text": (".csv", write_text),
        "matlab": (".mat", write_matlab),
        "mdf": (".mf4", write_mdf),
    }[kind]
    write(tmp_path / f"run{suffix}", rows(), {})
    (note,) = read(tmp_path / f"run{suffix}", dt=0.02).notes
    assert f"run{suffix}: dt = 0.02 s was taken as given, and the file's own time (" in note
    assert note.endswith("was not read. Leave dt out to read it.")


@pytest.mark.slow
def test_dates_count_in_seconds_from_the_first(tmp_path: Path) -> None:
    stamps = np.datetime64("2024-05-01T12:00:00", "us") + (10_000 * np.arange(120)).astype("timedelta64[us]")
    write_parquet(tmp_path / "run", rows() | {"t": stamps}, {})
    record = read(tmp_path / "run")
    assert (record.dt, record.t0) == (0.01, 0.0)


def test_whole_numbers_are_read_as_numbers(tmp_path: Path) -> None:
    counts = rows() | {"u": np.round(1000 * rows()["u"]).astype(np.int16)}
    write_hdf5(tmp_path / "run", counts, {})
    np.testing.assert_array_equal(read(tmp_path / "run")["u"], counts["u"].astype(np.float64))


@pytest.mark.slow
@pytest.mark.parametrize("write", [write_matlab, write_hdf5, write_mdf, write_tdms, write_parquet])
def test_a_gap_is_told_with_channel_and_sample(tmp_path: Path, write: Write) -> None:
    broken = rows()
    broken["psi"][7] = np.nan
    write(tmp_path / "run", broken, {})
    with pytest.raises(InputError, match=r"run, channel '.*psi', sample 8: nan"):
        read(tmp_path / "run")


def test_a_missing_channel_is_told_with_those_that_are_there(tmp_path: Path) -> None:
    write_matlab(tmp_path / "run.mat", {"t": rows()["t"], "current": rows()["u"], "psi": rows()["psi"]}, {})
    with pytest.raises(InputError, match=r"no channel 'u' for signal 'u'.*'t', 'current', 'psi'"):
        read(tmp_path / "run.mat")
    assert "y" not in read(tmp_path / "run.mat", columns={"u": ColumnMapping("current")})


def test_frequency_responses_are_listed_and_refused(tmp_path: Path) -> None:
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "run.uff"
    write_uff(path, rows(), {})
    response = {
        "type": 58, "binary": 0, "func_type": 4, "rsp_node": 9, "rsp_dir": 3, "ref_node": 1, "ref_dir": 1,
        "data": np.exp(1j * np.arange(60.0)), "x": np.arange(60.0), "id1": "FRF seat", "rsp_ent_name": "NONE",
        "ref_ent_name": "NONE", "abscissa_spacing": 1, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": 8,
        "orddenom_spec_data_type": 13,
    }  # fmt: skip
    pyuff.UFF(str(path)).write_sets([response], mode="add")
    with open_channels(path) as file:
        assert len(file.channels) == 3
        assert [(one.name, "frequency response" in one.reason) for one in file.refused] == [
            ("FRF seat", True)
        ]
    with pytest.raises(InputError, match=r"FRF seat.*is a frequency response function; a record needs"):
        read(path, columns={"u": ColumnMapping("FRF seat")})


@pytest.mark.parametrize("binary", [0, 1])
def test_universal_files_as_text_and_binary(tmp_path: Path, binary: int) -> None:
    write_uff(tmp_path / "run.uff", rows(), UNITS, binary=binary)
    np.testing.assert_allclose(read(tmp_path / "run.uff")["psi"], rows()["psi"], rtol=1e-11)


def test_a_dialect_means_nothing_for_other_formats(tmp_path: Path) -> None:
    write_matlab(tmp_path / "run.mat", rows(), {})
    with pytest.raises(InputError, match="separator does not apply"):
        read(tmp_path / "run.mat", separator=";")
