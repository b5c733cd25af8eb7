"""Small valid inputs from which the fuzzer starts."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np

from rigsight.rigs.published import published_sets
from rigsight.workflow.campaign.model_file import named_model

N_SAMPLES = 60
UNITS = {"u": "A", "psi": "rad", "y": "m"}
_FORMATS = Path(__file__).parents[2] / "tests/records/formats/files.py"

CAMPAIGN = """
title = "rear axle"
[rig]
model = "running_gear"
effects = ["coulomb_friction"]
[rig.constants]
v = 1.0
r_0 = 0.1
b = 0.3
k_tau = 0.27
[rig.parameters]
J_z = 0.56
k_c = 81.0
k_d = 2.0
l_0 = 0.25
c_y = 0.98
T_c = 0.1
[[records]]
file = "sweep.csv"
role = "estimation"
kind = "sweep"
amplitude = 0.25
hold = "foh"
separator = ","
decimal = "."
header = true
comment = "#"
resample = 0.01
[records.columns]
t = "t"
u = { name = "u", scale = 1.0, offset = 0.5 }
psi = { name = 3, unit = "rad" }
[[records]]
file = "sweep.csv"
name = "step"
role = "validation"
kind = "step"
dt = 0.01
"""
AXIS_CAMPAIGN = """
[rig]
model = "axis"
constants = { gain = 1.0 }
parameters = { m = 1.0, d = 2.0, k = 3.0 }
[[records]]
file = "sweep.csv"
columns = { t = 1, u = 2, x = 3 }
"""


def formats() -> ModuleType:
    """Return the module with which the tests write each format."""
    spec = importlib.util.spec_from_file_location("formats", _FORMATS)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows() -> dict[str, np.ndarray]:
    """Return a short record that every format can hold."""
    t = 0.01 * np.arange(N_SAMPLES)
    return {"t": t, "u": np.sin(9 * t), "psi": np.cos(9 * t), "y": np.sin(9 * t + 1)}


def write_samples(format_name: str, folder: Path) -> list[Path]:
    """Write files of one format by its own library: the record, and variants that other branches of a reader see."""
    module, record = formats(), rows()
    if format_name == "CSV":
        return _texts(folder)
    suffix, write = module.FORMATS[format_name]
    found = []
    singles = {name: samples.astype(np.float32) for name, samples in record.items()}
    whole = {name: (100 * samples).astype(np.int16) for name, samples in record.items()} | {"t": record["t"]}
    for label, variant in (("plain", record), ("single", singles), ("whole", whole)):
        path = folder / f"{label}{suffix}"
        try:
            write(path, variant, UNITS)
        except (ValueError, TypeError, OSError):
            # pyuff writes no whole numbers.
            continue
        found.append(path)
    if format_name == "UFF":
        path = folder / "text.uff"
        module.write_uff(path, record, UNITS, binary=0)
        found.append(path)
    if format_name in ("MATLAB 5", "MATLAB 7"):
        found += _matlab(folder, record, packed=format_name == "MATLAB 7")
    if format_name == "MATLAB 7.3":
        found.append(_matlab_groups(folder, record))
    if format_name == "HDF5":
        found += _hdf5(folder, record)
    if format_name == "TDMS":
        found.append(_tdms_clocks(folder, record))
    if format_name == "MDF4":
        found.append(_mdf_rasters(folder, record))
    return found


def _texts(folder: Path) -> list[Path]:
    table = np.column_stack(list(rows().values()))
    texts = {
        "comma.csv": "t,u,psi,y\n" + _lines(table, ","),
        "units.csv": "t;u;psi;y\ns;A;rad;m\n" + _lines(table, ";").replace(".", ","),
        "tabs.tsv": "# bench\nt\tu\tpsi\ty\n" + _lines(table, "\t"),
        "blanks.txt": "% t u psi y\n" + _lines(table, "  "),
        "quoted.csv": '"t","u","psi","y, mm"\n' + _lines(table, ","),
        "nothing.csv": _lines(table, ","),
        "two_clocks.csv": "t_u,u,t_psi,psi\n" + _lines(table[:, [0, 1, 0, 2]] + [0.0, 0.0, 0.004, 0.0], ","),
        "sentinels.csv": "t,u,psi,y\n" + _lines(np.where(table > 0.99, 9.9e37, table), ","),
        "thousands.csv": "t;u;psi\n"
        + "".join(f"{row[0]:.2f};{4e4 * row[1]:,.1f};{row[2]:.4f}\n" for row in table),
        "names.csv": "a1 torque cmd [Nm],X_Value,control[0]\n" + _lines(table[:, [1, 0, 2]], ","),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    (folder / "utf16.csv").write_text(texts["comma.csv"], encoding="utf-16")
    return sorted(folder.iterdir())


def _lines(table: np.ndarray, separator: str) -> str:
    return "".join(separator.join(f"{value:.6g}" for value in row) + "\n" for row in table)


def _matlab(folder: Path, record: dict[str, np.ndarray], packed: bool) -> list[Path]:
    from scipy.io import savemat
    from scipy.sparse import csc_array

    others = {
        "cell": np.array([np.arange(3.0), "text", {"a": 1.0}], dtype=object), "text": "bench", "empty": np.zeros((0, 0)),
        "wave": np.exp(1j * record["t"]), "is_on": record["t"] > 0.3, "sparse": csc_array(np.eye(4)),
        "deep": {"inner": {"u": record["u"]}, "u": record["u"]}, "table": np.column_stack(list(record.values())),
    }  # fmt: skip
    signals = np.zeros(3, dtype=[("values", object), ("label", object), ("dimensions", object)])
    for i, name in enumerate(("u", "psi", "y")):
        signals[i] = (record[name][:, None], name, 1.0)
    runs = np.array([[(record["t"], {"u": record["u"]})] * 2] * 2, dtype=[("t", object), ("drive", object)])
    logged = {"logsout": {"time": record["t"][:, None], "signals": signals}, "runs": runs}
    savemat(folder / "others.mat", record | others, do_compression=packed)
    late = {"time": record["t"] + 0.004, "psi": record["psi"]}
    logged |= {"scope_1": {"time": record["t"], "u": record["u"]}, "scope_2": late}
    savemat(folder / "logged.mat", logged, do_compression=packed)
    return [folder / "others.mat", folder / "logged.mat"]


def _matlab_groups(folder: Path, record: dict[str, np.ndarray]) -> Path:
    """Structs as MATLAB 7.3 keeps them: a struct is a group, an array of structs holds references."""
    import h5py

    path = folder / "groups.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, samples in record.items():
            file.create_dataset(f"run/inner/{name}", data=samples[None, :]).attrs["MATLAB_class"] = np.bytes_(
                "double"
            )
        file["run"].attrs["MATLAB_class"] = file["run/inner"].attrs["MATLAB_class"] = np.bytes_("struct")
        cells = file.create_dataset("cells", (1, 2), dtype=h5py.ref_dtype)
        cells[0, 0] = cells[0, 1] = file["run/inner/u"].ref
        cells.attrs["MATLAB_class"] = np.bytes_("cell")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(124) + b"\x00\x02IM")
    return path


def _hdf5(folder: Path, record: dict[str, np.ndarray]) -> list[Path]:
    import h5py

    plain, tables, packed = folder / "contiguous.h5", folder / "tables.h5", folder / "packed.h5"
    with h5py.File(packed, "w") as file:
        for name, samples in record.items():
            file[name] = np.round(1e3 * samples).astype(np.int16)
            file[name].attrs.update(
                {"scale_factor": 1e-3, "add_offset": 0.0, "_FillValue": np.int16(-32768), "units": "mm"}
            )
    with h5py.File(plain, "w") as file:
        for name, samples in record.items():
            file[name] = samples
    with h5py.File(tables, "w", libver="latest") as file:
        file["run"] = np.column_stack(list(record.values()))
        file["note"] = "text"
        file["alias"] = h5py.SoftLink("/run")
    return [plain, tables, packed]


def _tdms_clocks(folder: Path, record: dict[str, np.ndarray]) -> Path:
    """Two waveforms that start at different times, and one with stamps of its own."""
    from nptdms import ChannelObject, TdmsWriter

    path, start = folder / "clocks.tdms", np.datetime64("2026-11-27T08:00:00")
    with TdmsWriter(path) as writer:
        for i, name in enumerate(("u", "psi")):
            own = {"wf_start_time": start + np.timedelta64(4 * i, "ms"), "wf_increment": 0.01}
            writer.write_segment([ChannelObject(f"scope {i}", name, record[name], own)])
        stamps = start + np.round(1e6 * record["t"]).astype("timedelta64[us]")
        writer.write_segment([ChannelObject("slow", "t", stamps), ChannelObject("slow", "y", record["y"])])
    return path


def _mdf_rasters(folder: Path, record: dict[str, np.ndarray]) -> Path:
    """Groups of two rasters, and a channel whose first samples are invalid."""
    from asammdf import MDF, Signal

    path, t = folder / "rasters.mf4", record["t"]
    invalid = np.arange(t.size) < 5
    with MDF(version="4.10") as file:
        file.append([Signal(record["u"], t, name="u", unit="A")])
        file.append([Signal(record["psi"][::2], t[::2], name="psi", unit="rad")])
        file.append([Signal(record["y"], t, name="y", unit="m", invalidation_bits=invalid)])
        file.save(path, overwrite=True)
    return path


def model_texts() -> list[str]:
    """Return the text of sound model files."""
    return [json.dumps(named_model(name).to_json()) for name in list(published_sets())[:3]]


KEYS = (
    {"kind": "single", "effects": ["backlash"]},
    {
        "schema_version": 1, "kind": "pair", "effects": ["backlash", "coulomb_friction"],
        "parameters": {"g": 1.5e-4, "T_c": 0.1}, "noise_floor": {"psi": 2.6e-5}, "gap": 7.5,
        "where": ["yaw_dynamics"], "noise": "low",
        "withheld": [{"file": "step.csv", "kind": "step", "hold": "zoh"}],
    },
    {"kind": "outside", "effects": ["rust"], "parameters": {"r": 1.0}, "where": ["sensor"]},
)  # fmt: skip


def comma_text() -> str:
    """Return the record as plain text."""
    return "t,u,psi,y\n" + _lines(np.column_stack(list(rows().values())), ",")
