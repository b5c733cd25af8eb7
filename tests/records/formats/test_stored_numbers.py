"""What a file says of its stored numbers is done to them, in every format; what may be meant is asked about."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping, ReadingOptions, Record, read_record
from rigsight.records.formats.channel import Stored, stored_by
from rigsight.records.formats.channel_file import open_channels

from ...tiers import slow_but


@dataclass(frozen=True)
class Named:
    name: str
    unit: str


T = 0.01 * np.arange(200)
U = np.sin(3.0 * T**2)
X = 2.0 + np.sin(3.0 * T**2 - 0.4)
COUNTS = np.round((X - 2.0) / 0.001).astype(np.int16)


def read(path: Path, **options: object) -> Record:
    return read_record(path, (Named("u", "A"),), (Named("x", "m"),), ReadingOptions(**options))


def write_hdf5(path: Path, x: np.ndarray, **attributes: Any) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, samples in {"t": T, "u": U, "x": x}.items():
            file[name] = samples
        file["x"].attrs.update(attributes)
    return path


@pytest.mark.parametrize(
    "names", [("scale_factor", "add_offset"), ("conversion", "offset")], ids=["CF", "NWB"]
)
def test_packed_numbers_are_unpacked_before_their_unit_and_told(
    tmp_path: Path, names: tuple[str, str]
) -> None:
    path = write_hdf5(tmp_path / "run.h5", COUNTS, **dict(zip(names, (0.001, 2.0), strict=True)), units="mm")
    record = read(path)
    np.testing.assert_allclose(record["x"], 1e-3 * (0.001 * COUNTS + 2.0), rtol=1e-14)
    assert any("0.001 * stored number + 2" in note for note in record.notes)


@pytest.mark.parametrize(
    "attributes",
    [
        {"_FillValue": np.int16(-32767)},
        {"missing_value": np.int16(-32767)},
        {"valid_range": np.array([-2000, 2000], dtype=np.int16)},
        {"valid_min": np.int16(-2000)},
    ],
    ids=lambda one: next(iter(one)),
)
def test_missing_and_invalid_numbers_are_no_readings(tmp_path: Path, attributes: dict[str, Any]) -> None:
    counts = COUNTS.copy()
    counts[17] = -32767
    path = write_hdf5(tmp_path / "run.h5", counts, scale_factor=0.001, **attributes)
    with pytest.raises(InputError, match=r"channel 'x', sample 18: nan .*1 such"):
        read(path)


def test_fill_values_of_another_type_match_no_number() -> None:
    stored = Stored(missing=(-9999.0,)).quantity(np.arange(256, dtype=np.uint8))
    assert np.isfinite(stored).all()
    single = np.array([1.0, 9.96921e36], dtype=np.float32)
    assert np.isnan(Stored(missing=(9.96921e36,)).quantity(single)).tolist() == [False, True]


def test_bytes_that_are_unsigned_are_read_so() -> None:
    stored = stored_by({"_Unsigned": "true", "scale_factor": 2.0})
    assert stored.quantity(np.array([-1, 1], dtype=np.int8)).tolist() == [510.0, 2.0]


@pytest.mark.parametrize(
    "name",
    slow_but("Factor", "offset", of=["scale", "gain", "Factor", "cal_slope", "scaling_factor", "offset"]),
)
def test_an_attribute_of_no_convention_is_asked_about(tmp_path: Path, name: str) -> None:
    path = write_hdf5(tmp_path / "run.h5", COUNTS, **{name: 0.25})
    with pytest.raises(InputError) as caught:
        read(path)
    assert f"{name} = 0.25" in str(caught.value)
    given = read(path, columns={"x": ColumnMapping("x", scale=0.5)})
    np.testing.assert_array_equal(given["x"], 0.5 * COUNTS)
    # Numbers with a point may be converted already.
    reported = read(write_hdf5(tmp_path / "floats.h5", X, **{name: 0.25}))
    np.testing.assert_array_equal(reported["x"], X)
    assert any(f"{name} = 0.25" in note for note in reported.notes)


def test_attributes_that_are_no_conversion_are_passed_over() -> None:
    odd = {
        "long_name": "gain of x",
        "grayscale": 3.0,
        "serial": 17,
        "scale": np.arange(40.0),
        "gain": 1.0,
        "offset": 0.0,
    }
    assert stored_by(odd) == Stored()


@pytest.mark.slow
def test_invalid_samples_of_an_mdf_channel_keep_the_others_at_their_times(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    invalid = T < 0.2
    signals = [
        asammdf.Signal(U, T, name="u", unit="A"),
        asammdf.Signal(X, T, name="x", unit="m"),
        asammdf.Signal(X, T, name="oil", unit="degC", invalidation_bits=invalid),
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        path = Path(file.save(tmp_path / "run.mf4", overwrite=True))
    np.testing.assert_array_equal(read(path)["x"], X)
    with open_channels(path) as opened:
        (oil,) = [channel for channel in opened.channels if channel.name == "oil"]
        np.testing.assert_array_equal(np.isnan(oil.load()), invalid)
    with pytest.raises(InputError, match=r"'oil', sample 1: nan .*20 such"):
        read(path, columns={"x": ColumnMapping("oil", scale=1.0)})


def write_tdms(path: Path, properties: dict[str, Any]) -> Path:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(
            [
                nptdms.ChannelObject("g", name, samples, properties=own)
                for name, samples, own in (("t", T, {}), ("u", U, {}), ("x", COUNTS, properties))
            ]
        )
    return path


SCALED = {
    "NI_Number_Of_Scales": 1,
    "NI_Scaling_Status": "unscaled",
    "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
}


def test_scales_of_a_tdms_file_are_applied_and_unknown_ones_refused(tmp_path: Path) -> None:
    line = {
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.001,
        "NI_Scale[0]_Linear_Y_Intercept": 2.0,
    }
    linear = write_tdms(tmp_path / "linear.tdms", {**SCALED, **line})
    np.testing.assert_allclose(read(linear)["x"], 0.001 * COUNTS + 2.0, rtol=1e-12)
    unknown = write_tdms(tmp_path / "unknown.tdms", {**SCALED, "NI_Scale[0]_Scale_Type": "Reciprocal"})
    with pytest.raises(InputError, match=r"'g/x'.*Reciprocal"):
        read(unknown)
    asked = write_tdms(tmp_path / "asked.tdms", {"gain": 0.25})
    with pytest.raises(InputError, match=r"gain = 0\.25"):
        read(asked)


def test_metadata_of_a_parquet_column_count_like_attributes(tmp_path: Path) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    fields = [
        arrow.field("t", arrow.float64()),
        arrow.field("u", arrow.float64()),
        arrow.field("x", arrow.int16(), metadata={"scale_factor": "0.001", "add_offset": "2", "unit": "mm"}),
    ]
    parquet.write_table(arrow.table([T, U, COUNTS], schema=arrow.schema(fields)), tmp_path / "run.parquet")
    record = read(tmp_path / "run.parquet")
    np.testing.assert_allclose(record["x"], 1e-3 * (0.001 * COUNTS + 2.0), rtol=1e-14)
