"""Exported models compared with the engine, in one run: difference and time per sample.

30 s of a sweep sampled at 10 ms, an effect at a time on the running gear. C and FMU hold the engine: what they differ from it by
is rounding. Python steps by itself; the truth is the engine's answer at 1e-9, where it aims for 1e-6 otherwise. Times are those
of the fastest of several runs; compare the ratios.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.export.targets import export_model
from rigsight.libraries.library_cache import c_compilers
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate
from rigsight.simulate.model import Model

Floats = NDArray[np.float64]

DT = 0.01
N_SAMPLES = 3000
GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip
MODELS: dict[str, dict[str, float]] = {
    "": {},
    "cubic_stiffness": {"k_3": 3e5},
    "bouc_wen_hysteresis": {"A": 1.0, "a": 0.48, "beta": 736.0, "gamma": -716.0, "n": 1.0},
    "iwan_hysteresis": {"a": 0.3, "x_s": 0.01, "q": -0.4},
    "backlash": {"g": 0.002},
    "coulomb_friction": {"T_c": 0.1},
    "stribeck_friction": {"T_c": 0.08, "T_s": 0.16, "w_s": 0.02},
    "end_stop": {"k_s": 300.0, "s": 0.006},
    "flexible_mode": {"m_a": 0.1, "w_a": 20.0, "zeta_a": 0.05},
    "input_delay": {"T_d": 0.033},
    "sensor_delay": {"T_s": 0.027},
}
LOOP = """
#include "rig.c"
int simulate(const double *u, long n, double dt, double *y) {
    static rig_model m;
    long i;
    int status = rig_init(&m, 0, u);
    rig_outputs(&m, y);
    for (i = 0; i + 1 < n; i++) {
        status |= rig_step(&m, dt, u + i, u + i + 1);
        rig_outputs(&m, y + 2 * (i + 1));
    }
    return status;
}
"""


@dataclass(frozen=True)
class Row:
    """Results of one model: errors against the truth, and differences from the engine."""

    name: str
    engine_error: float
    python_error: float
    c_difference: float
    fmu_difference: float
    engine: float
    c: float
    fmu: float
    python: float


def main() -> None:
    head = f"{'error':>40} {'from the engine':>17} {'ns per sample':>33} {'ratios':>20}"
    print(f"{head}\n{'model':22} {'engine':>8} {'python':>8} {'C':>8} {'FMU':>8}", end="")
    print(f" {'engine':>9} {'C':>7} {'FMU':>8} {'python':>9} {'engine/C':>10} {'FMU/C':>7} {'python/C':>9}")
    for name, values in MODELS.items():
        row = measured(name, values)
        print(
            f"{row.name:22} {row.engine_error:8.1e} {row.python_error:8.1e} {row.c_difference:8.1e} {row.fmu_difference:8.1e}"
            f" {row.engine:9.0f} {row.c:7.0f} {row.fmu:8.0f} {row.python:9.0f}"
            f" {row.engine / row.c:10.2f} {row.fmu / row.c:7.1f} {row.python / row.c:9.0f}",
            flush=True,
        )


def measured(name: str, values: dict[str, float]) -> Row:
    structure = compose(RUNNING_GEAR, [effect_named(name)] if name else [])
    model = Model(structure, {**GEAR, **values}, "foh")
    t = DT * np.arange(N_SAMPLES)
    u = linear_sweep(t, 1.0, 2.0, 40.0)
    record = Record(name="sweep", dt=DT, signals={"u": u}, units={"u": "A"})
    truth = table(simulate(structure, model.values, record, accuracy=1e-9))
    engine, of_engine = fastest(lambda: table(simulate(structure, model.values, record)))
    space: dict[str, Any] = {}
    exec(str(export_model(model, "python", source="model.json")), space)
    python, of_python = fastest(lambda: np.column_stack(list(space["simulate"](t, u).values())), 1)
    with tempfile.TemporaryDirectory() as place:
        c, of_c = fastest(c_loop(model, Path(place), u))
        fmu, of_fmu = fastest(fmu_loop(model, Path(place), u))
    errors = [difference(outputs, truth) for outputs in (of_engine, of_python)]
    differences = [difference(outputs, of_engine) for outputs in (of_c, of_fmu)]
    return Row(name or "linear", *errors, *differences, engine, c, fmu, python)


def table(record: Record) -> Floats:
    return np.column_stack([record["psi"], record["y"]])


def difference(outputs: Floats, truth: Floats) -> float:
    return float(np.max(np.linalg.norm(outputs - truth, axis=0) / np.linalg.norm(truth, axis=0)))


def fastest(run: Callable[[], Floats], repeats: int = 5) -> tuple[float, Floats]:
    """Return nanoseconds per sample and the outputs."""
    best, outputs = np.inf, run()
    for _ in range(repeats):
        start = time.perf_counter()
        outputs = run()
        best = min(best, time.perf_counter() - start)
    return best / N_SAMPLES * 1e9, outputs


def c_loop(model: Model, place: Path, u: Floats) -> Callable[[], Floats]:
    (place / "rig.c").write_text(
        str(export_model(model, "c", source="model.json", name="rig")), encoding="utf-8"
    )
    (place / "loop.c").write_text(LOOP, encoding="utf-8")
    options = ["-O2", "-std=c99", "-shared", "-fPIC", "-o", "loop.so", "loop.c", "-lm"]
    subprocess.run([*c_compilers()[0].command, *options], cwd=place, check=True)
    library = ctypes.CDLL(str(place / "loop.so"))
    y = np.zeros((N_SAMPLES, 2))
    doubles = ctypes.POINTER(ctypes.c_double)

    def run() -> Floats:
        status = library.simulate(
            u.ctypes.data_as(doubles), ctypes.c_long(u.size), ctypes.c_double(DT), y.ctypes.data_as(doubles)
        )
        assert status == 0
        return y.copy()

    return run


def fmu_loop(model: Model, place: Path, u: Floats) -> Callable[[], Floats]:
    """Drive the FMU through fmpy, one Python call for each value; the time includes fmpy itself."""
    try:
        import fmpy
        from fmpy.fmi2 import FMU2Slave
    except ImportError:
        return lambda: np.full((u.size, 2), np.nan)
    content = export_model(model, "fmu", source="model.json", name="rig")
    assert isinstance(content, bytes)
    (place / "rig.fmu").write_bytes(content)
    folder = fmpy.extract(str(place / "rig.fmu"), str(place / "extracted"))
    description = fmpy.read_model_description(folder)
    references = {v.name: v.valueReference for v in description.modelVariables}
    # Names that a state has too are those of the outputs: states are not shown.
    outputs = [references["psi"], references["y"]]

    def run() -> Floats:
        slave = FMU2Slave(
            guid=description.guid, unzipDirectory=folder, modelIdentifier="rig", instanceName="rig"
        )
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.setReal([references["u"]], [u[0]])
        slave.exitInitializationMode()
        rows = [slave.getReal(outputs)]
        slopes = np.diff(u) / DT
        for i, slope in enumerate(slopes):
            slave.setReal([references["u"]], [u[i]])
            slave.setRealInputDerivatives([references["u"]], [1], [slope])
            slave.doStep(DT * i, DT)
            rows.append(slave.getReal(outputs))
        slave.terminate()
        slave.freeInstance()
        return np.array(rows)

    return run


if __name__ == "__main__":
    main()
