"""How does the own library of each format write channels?"""

from __future__ import annotations

import json
import shutil
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

Rows = Mapping[str, np.ndarray]
"""Channel name -> samples; ``t`` is time."""
Units = Mapping[str, str]
Write = Callable[[Path, Rows, Units], None]


def write_text(path: Path, rows: Rows, units: Units) -> None:
    lines = [
        ",".join(rows),
        *(",".join(repr(float(v)) for v in row) for row in zip(*rows.values(), strict=True)),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def write_matlab(path: Path, rows: Rows, units: Units) -> None:
    from scipy.io import savemat

    savemat(path, {name: samples[:, None] for name, samples in rows.items()})


def write_matlab_packed(path: Path, rows: Rows, units: Units) -> None:
    from scipy.io import savemat

    savemat(path, {"run": dict(rows)}, do_compression=True)


def write_matlab_hdf5(path: Path, rows: Rows, units: Units) -> None:
    """As MATLAB does: a head of 512 bytes in front, arrays transposed, the class as an attribute."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, samples in rows.items():
            file.create_dataset(name, data=samples[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124)
        file.write(head + b"\x00\x02IM")


def write_hdf5(path: Path, rows: Rows, units: Units) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, samples in rows.items():
            dataset = file.create_dataset(f"run 1/{name}", data=samples, compression="gzip")
            if name in units:
                dataset.attrs["unit"] = units[name]


def write_mdf(path: Path, rows: Rows, units: Units) -> None:
    asammdf = pytest.importorskip("asammdf")
    signals = [
        asammdf.Signal(samples, rows["t"], name=name, unit=units.get(name, ""))
        for name, samples in rows.items()
        if name != "t"
    ]
    with asammdf.MDF(version="4.10") as file:
        file.append(signals, comment="bench")
        # The library insists on its suffix.
        file.save(path.with_suffix(".mf4"), overwrite=True).rename(path)


def write_tdms(path: Path, rows: Rows, units: Units) -> None:
    nptdms = pytest.importorskip("nptdms")
    time = rows["t"]
    channels: list[Any] = []
    for name, samples in rows.items():
        properties: dict[str, Any] = {"unit_string": units[name]} if name in units else {}
        if name != "t":
            properties |= {"wf_increment": float(time[1] - time[0]), "wf_start_offset": float(time[0])}
            channels.append(nptdms.ChannelObject("Messung", name, samples, properties=properties))
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def write_parquet(path: Path, rows: Rows, units: Units) -> None:
    arrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    fields = [
        arrow.field(name, arrow.from_numpy_dtype(samples.dtype), metadata={"unit": units.get(name, "")})
        for name, samples in rows.items()
    ]
    parquet.write_table(arrow.table(list(rows.values()), schema=arrow.schema(fields)), path)


def write_uff(path: Path, rows: Rows, units: Units, binary: int = 1) -> None:
    pyuff = pytest.importorskip("pyuff")
    time = rows["t"]
    sets = [
        {
            "type": 58, "binary": binary, "func_type": 1, "rsp_node": i + 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1,
            "data": samples, "x": time, "id1": name, "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
            "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "abscissa_min": float(time[0]),
            "abscissa_inc": float(time[1] - time[0]), "abscissa_axis_units_lab": "s",
            "ordinate_spec_data_type": 8, "ordinate_axis_units_lab": units.get(name, "NONE"),
            "orddenom_spec_data_type": 0,
        }
        for i, (name, samples) in enumerate(rows.items())
        if name != "t"
    ]  # fmt: skip
    # Overwriting loses the first binary dataset (pyuff 2.5); appending to nothing does not.
    path.unlink(missing_ok=True)
    pyuff.UFF(str(path)).write_sets(sets, mode="add", force_double=True)


def write_json(path: Path, rows: Rows, units: Units) -> None:
    columns = {name: samples.tolist() for name, samples in rows.items()}
    path.write_text(
        json.dumps([dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)])
    )


def _write_joint_states(bag: Any, rows: Rows, store: Any, serialize: Any) -> None:
    types = store.types
    topic = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
    names = [name for name in rows if name != "t"]
    for index, time in enumerate(rows["t"]):
        stamp = types["builtin_interfaces/msg/Time"](1_700_000_000 + int(time), round(1e9 * (time % 1.0)))
        head = {"stamp": stamp, "frame_id": ""}
        if "seq" in types["std_msgs/msg/Header"].__dataclass_fields__:
            head["seq"] = index
        message = types["sensor_msgs/msg/JointState"](
            header=types["std_msgs/msg/Header"](**head),
            name=names,
            position=np.array([rows[name][index] for name in names], dtype=np.float64),
            velocity=np.zeros(0),
            effort=np.zeros(0),
        )
        # Received a little later than stamped, and never evenly.
        received = 1_700_000_000_001_000_000 + round(1e9 * time) + (index * 7919) % 500_000
        bag.write(topic, received, serialize(message, "sensor_msgs/msg/JointState"))


def write_rosbag1(path: Path, rows: Rows, units: Units) -> None:
    rosbag1, typesys = pytest.importorskip("rosbags.rosbag1"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC)
    path.unlink(missing_ok=True)
    with rosbag1.Writer(path) as bag:
        _write_joint_states(bag, rows, store, store.serialize_ros1)


def _write_rosbag2(path: Path, rows: Rows, plugin: str) -> None:
    rosbag2, typesys = pytest.importorskip("rosbags.rosbag2"), pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    with TemporaryDirectory() as folder:
        bag_path = Path(folder) / "bag"
        with rosbag2.Writer(bag_path, version=9, storage_plugin=rosbag2.StoragePlugin[plugin]) as bag:
            _write_joint_states(bag, rows, store, store.serialize_cdr)
        (written,) = bag_path.glob("bag.*")
        shutil.move(written, path)


def write_mcap(path: Path, rows: Rows, units: Units) -> None:
    _write_rosbag2(path, rows, "MCAP")


def write_rosbag2(path: Path, rows: Rows, units: Units) -> None:
    _write_rosbag2(path, rows, "SQLITE3")


def write_ulog(path: Path, rows: Rows, units: Units) -> None:
    """As https://docs.px4.io/main/en/dev_log/ulog_file_format.html describes it."""
    names = [name for name in rows if name != "t"]

    def record(kind: bytes, content: bytes) -> bytes:
        return struct.pack("<HB", len(content), kind[0]) + content

    fields = "".join(f"double {name};" for name in names)
    parts = [
        b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0),
        record(b"B", bytes(40)),
        record(b"F", f"bench:uint64_t timestamp;{fields}".encode()),
        record(b"A", struct.pack("<BH", 0, 0) + b"bench"),
    ]
    for index, time in enumerate(rows["t"]):
        numbers = struct.pack(f"<{len(names)}d", *(rows[name][index] for name in names))
        parts.append(record(b"D", struct.pack("<HQ", 0, round(1e6 * time)) + numbers))
    path.write_bytes(b"".join(parts))


FORMATS: dict[str, tuple[str, Write]] = {
    "MATLAB 5": (".mat", write_matlab),
    "MATLAB 7": (".mat", write_matlab_packed),
    "MATLAB 7.3": (".mat", write_matlab_hdf5),
    "HDF5": (".h5", write_hdf5),
    "MDF4": (".mf4", write_mdf),
    "TDMS": (".tdms", write_tdms),
    "Parquet": (".parquet", write_parquet),
    "UFF": (".uff", write_uff),
    "JSON": (".json", write_json),
    "ROS 1 bag": (".bag", write_rosbag1),
    "ROS 2 bag": (".db3", write_rosbag2),
    "MCAP": (".mcap", write_mcap),
    "ULog": (".ulg", write_ulog),
}
"""Name -> suffix and writer; delimited text is left out."""

UNITS = {"u": "A", "psi": "rad", "y": "m"}


def rows(n_samples: int = 120, dt: float = 0.01) -> dict[str, np.ndarray]:
    t = dt * np.arange(n_samples)
    return {
        "t": t,
        "u": np.sin(3 * t**2),
        "psi": 0.1 * np.sin(3 * t**2 - 0.4),
        "y": 0.01 * np.cos(2 * t),
    }
