"""The exported FMU: valid, and with the outputs of the engine in fmpy."""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import threading
import time
import zipfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.export import export_model
from rigsight.export.fmu import c_compiler

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (pip install fmpy lxml)")
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


def written(case, folder: Path, **options) -> Path:
    content = export_model(case.model, "fmu", source="model.json", name="rig", **options)
    assert isinstance(content, bytes)
    path = folder / "rig.fmu"
    path.write_bytes(content)
    return path


class Slave:
    """An FMU driven from outside, with the first derivatives of its inputs."""

    def __init__(self, path: Path, folder: Path) -> None:
        from fmpy.fmi2 import FMU2Slave

        place = fmpy.extract(str(path), str(folder / "extracted"))
        description = fmpy.read_model_description(place)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.names = {
            kind: [v.name for v in description.modelVariables if v.causality == kind]
            for kind in ("input", "output")
        }
        self.slave = FMU2Slave(
            guid=description.guid, unzipDirectory=place, modelIdentifier="rig", instanceName="rig"
        )
        self.slave.instantiate()

    def run(self, case, linear: bool) -> dict[str, np.ndarray]:
        slave = self.slave
        inputs = [self.references[name] for name in self.names["input"]]
        outputs = [self.references[name] for name in self.names["output"]]
        signals = np.column_stack(case.inputs)
        dt = case.t[1]
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.setReal(inputs, signals[0].tolist())
        slave.exitInitializationMode()
        rows = [slave.getReal(outputs)]
        for i in range(len(case.t) - 1):
            slave.setReal(inputs, signals[i].tolist())
            if linear:
                slopes = (signals[i + 1] - signals[i]) / dt
                slave.setRealInputDerivatives(inputs, [1] * len(inputs), slopes.tolist())
            slave.doStep(case.t[i], dt)
            rows.append(slave.getReal(outputs))
        slave.terminate()
        slave.freeInstance()
        table = np.array(rows)
        # An output that is a word taken already is called output_NAME.
        return {name.removeprefix("output_"): table[:, i] for i, name in enumerate(self.names["output"])}


def test_it_gives_the_outputs_of_the_engine(case, tmp_path: Path):
    simulated = Slave(written(case, tmp_path), tmp_path).run(case, linear=case.model.hold != "zoh")
    assert max(case.errors(simulated).values()) <= 1e-6
    assert max(case.errors(simulated, told=True).values()) <= (1e-6 if case.smooth else 2e-5)


@pytest.mark.parametrize("name", ["axis held constant", "all delays", "jumps into kinks"])
def test_fmpy_simulates_a_constant_hold_by_itself(name: str, case_named, tmp_path: Path):
    case = case_named(name)
    signal = np.array(list(zip(case.t, case.inputs[0], strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        str(written(case, tmp_path)),
        stop_time=case.t[-1],
        output_interval=case.t[1],
        input=signal,
        validate=False,
    )
    simulated = {name: result[name] for name in case.outputs}
    assert len(simulated[case.outputs[0]]) == len(case.t)
    assert max(case.errors(simulated).values()) <= 1e-6


@pytest.mark.parametrize("name", ["linear axis", "all delays", "element with hysteresis", "friction twice"])
def test_it_is_valid(name: str, case_named, tmp_path: Path):
    pytest.importorskip("lxml", reason="lxml is not installed (pip install fmpy lxml)")
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(written(case_named(name), tmp_path))) == []


def test_parameters_can_be_set_before_the_start(case_named, tmp_path: Path):
    case, linear = case_named("cubic_stiffness"), case_named("linear running gear")
    slave = Slave(written(case, tmp_path), tmp_path)
    slave.slave.setReal([slave.references["k_3"]], [0.0])
    assert max(linear.errors(slave.run(linear, linear=True)).values()) <= 1e-6


def test_a_state_can_be_kept_and_taken_up_again(case_named, tmp_path: Path):
    case = case_named("backlash")
    slave = Slave(written(case, tmp_path), tmp_path)
    slave.slave.setupExperiment(startTime=0.0)
    slave.slave.enterInitializationMode()
    slave.slave.exitInitializationMode()
    references = [slave.references["u"]], [slave.references["psi"]]

    def go() -> list[float]:
        for i in range(20):
            slave.slave.setReal(references[0], [1.0])
            slave.slave.doStep(0.01 * i, 0.01)
        return slave.slave.getReal(references[1])

    kept = slave.slave.getFMUState()
    first = go()
    slave.slave.setFMUState(kept)
    slave.slave.freeFMUState(kept)
    assert go() == first
    slave.slave.terminate()
    slave.slave.freeInstance()


def test_the_same_model_gives_the_same_bytes(case_named, tmp_path: Path):
    model = case_named("backlash").model
    first, second = (export_model(model, "fmu", source="model.json", name="rig") for _ in range(2))
    assert first == second


def test_its_sources_compile_without_a_warning(case_named, tmp_path: Path):
    import subprocess

    archive = zipfile.ZipFile(written(case_named("all delays"), tmp_path, source_only=True))
    names = archive.namelist()
    assert sorted(names) == ["modelDescription.xml", "sources/fmi2_rig.c", "sources/rig.c"]
    archive.extractall(tmp_path)
    command = [
        "gcc",
        "-O2",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-std=c99",
        "-pedantic",
        "-shared",
        "-fPIC",
        "-o",
        "rig.so",
    ]
    run = subprocess.run(
        [*command, "fmi2_rig.c", "-lm"], cwd=tmp_path / "sources", capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr


def test_without_a_compiler_the_way_out_is_named(case_named, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PATH", "/nonexistent")
    monkeypatch.delenv("CC", raising=False)
    assert c_compiler() is None
    with pytest.raises(InputError, match=r"No C compiler was found.*--source-only"):
        export_model(case_named("linear axis").model, "fmu", source="model.json")


def test_a_compiler_that_fails_is_named(case_named, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CC", "false")
    with pytest.raises(InputError, match="false failed"):
        export_model(case_named("linear axis").model, "fmu", source="model.json")


def test_a_compiler_without_room_on_the_disk_is_not_blamed(case_named, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("CC", "false")
    full = SimpleNamespace(total=10**9, used=10**9, free=0)
    monkeypatch.setattr("rigsight.export.fmu.shutil.disk_usage", lambda _: full)
    with pytest.raises(OSError, match="No space left") as told:
        export_model(case_named("linear axis").model, "fmu", source="model.json")
    assert told.value.filename


@pytest.mark.skipif(os.name == "nt", reason="a shell script stands for the compiler")
def test_an_interrupted_compiler_leaves_no_file_and_no_helper(
    case_named, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    compiler, mark = tmp_path / "cc", tmp_path / "mark"
    compiler.write_text(f'#!/bin/sh\necho > "$TMPDIR/part.s"\nsleep 60 & echo $! > {mark}\nwait\n', "utf-8")
    compiler.chmod(0o755)
    place = tmp_path / "tmp"
    place.mkdir()
    monkeypatch.setenv("CC", str(compiler))
    monkeypatch.setattr(tempfile, "tempdir", str(place))

    def interrupt() -> None:
        while not (mark.exists() and mark.read_text()):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        export_model(case_named("linear axis").model, "fmu", source="model.json")
    thread.join()
    assert list(place.iterdir()) == []
    helper = Path("/proc") / mark.read_text().strip() / "stat"
    assert not helper.exists() or helper.read_text().rpartition(")")[2].split()[0] == "Z"
