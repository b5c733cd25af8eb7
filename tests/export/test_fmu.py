"""The exported FMU: valid, and with the outputs of the engine in fmpy."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.export.targets import export_model
from rigsight.libraries.library_cache import c_compilers, kernel_options

from ..tiers import slow_but

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed (pip install fmpy lxml)")

OTHER_ROUNDING = 1e-8
"""As for C that is not compiled for this processor alone."""
VERSIONS = ("fmu", "fmu3")
STRICT = ("-O2", "-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic", "-shared", "-fPIC")


def written(case, folder: Path, target: str = "fmu", **options) -> Path:
    content = export_model(case.model, target, source="model.json", name="rig", **options)
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


class Slave3(Slave):
    """The same by FMI 3.0, where the slopes are inputs too."""

    def __init__(self, path: Path, folder: Path) -> None:
        from fmpy.fmi3 import FMU3Slave

        place = fmpy.extract(str(path), str(folder / "extracted"))
        description = fmpy.read_model_description(place)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.names = {
            kind: [v.name for v in description.modelVariables if v.causality == kind]
            for kind in ("input", "output")
        }
        self.slave = FMU3Slave(
            guid=description.guid, unzipDirectory=place, modelIdentifier="rig", instanceName="rig"
        )
        self.slave.instantiate()

    def run(self, case, linear: bool) -> dict[str, np.ndarray]:
        slave = self.slave
        slopes = [self.references[name] for name in self.names["input"] if name.endswith("_slope")]
        inputs = [self.references[name] for name in self.names["input"] if not name.endswith("_slope")]
        assert len(slopes) == (len(inputs) if linear else 0)
        outputs = [self.references[name] for name in self.names["output"]]
        signals = np.column_stack(case.inputs)
        dt = case.t[1]
        slave.enterInitializationMode(startTime=0.0)
        slave.setFloat64(inputs, signals[0].tolist())
        slave.exitInitializationMode()
        rows = [slave.getFloat64(outputs)]
        for i in range(len(case.t) - 1):
            values = signals[i].tolist()
            if linear:
                values += ((signals[i + 1] - signals[i]) / dt).tolist()
            slave.setFloat64(inputs + slopes, values)
            slave.doStep(case.t[i], dt)
            rows.append(slave.getFloat64(outputs))
        assert slave.getFloat64([self.references["time"]]) == pytest.approx([case.t[-1]])
        slave.terminate()
        slave.freeInstance()
        table = np.array(rows)
        return {name.removeprefix("output_"): table[:, i] for i, name in enumerate(self.names["output"])}


SLAVES = {"fmu": Slave, "fmu3": Slave3}
ALL_THAT_A_WRAPPER_TELLS = (
    "start under load", "all delays", "element with hysteresis", "one effect twice", "a control law behind lags",
    "a mass matrix of coordinates", "an arm held constant", "a prescribed road",
)  # fmt: skip
"""Holds, first inputs, several inputs, slopes that are inputs, names: what differs in the C around the model. The model itself is
the exported C, as is tested with its sources, and every model is held to the engine as C."""


@pytest.mark.parametrize("target", VERSIONS)
@pytest.mark.parametrize(
    "name", slow_but("one effect twice", "a prescribed road", of=ALL_THAT_A_WRAPPER_TELLS)
)
def test_it_gives_the_outputs_of_the_engine_to_rounding(name: str, target: str, case_named, tmp_path: Path):
    case = case_named(name)
    path = written(case, tmp_path, target)
    simulated = SLAVES[target](path, tmp_path).run(case, linear=case.model.hold != "zoh")
    assert max(case.errors(simulated, reported=True).values()) <= OTHER_ROUNDING


@pytest.mark.parametrize("target", VERSIONS)
@pytest.mark.parametrize(
    "name", slow_but("all delays", of=["axis held constant", "all delays", "jumps into kinks"])
)
def test_fmpy_simulates_a_constant_hold_by_itself(name: str, target: str, case_named, tmp_path: Path):
    case = case_named(name)
    signal = np.array(list(zip(case.t, case.inputs[0], strict=True)), dtype=[("time", float), ("u", float)])
    result = fmpy.simulate_fmu(
        str(written(case, tmp_path, target)),
        stop_time=case.t[-1],
        output_interval=case.t[1],
        input=signal,
        validate=False,
    )
    simulated = {name: result[name] for name in case.outputs}
    assert len(simulated[case.outputs[0]]) == len(case.t)
    assert max(case.errors(simulated, reported=True).values()) <= OTHER_ROUNDING


def test_fmpy_simulates_straight_lines_by_fmi_3_with_slopes(case_named, tmp_path: Path):
    case = case_named("backlash")
    u = case.inputs[0]
    slopes = np.append(np.diff(u) / case.t[1], 0.0)
    signal = np.array(
        list(zip(case.t, u, slopes, strict=True)), dtype=[("time", float), ("u", float), ("u_slope", float)]
    )
    result = fmpy.simulate_fmu(
        str(written(case, tmp_path, "fmu3")),
        stop_time=case.t[-1],
        output_interval=case.t[1],
        input=signal,
        output=list(case.outputs),
    )
    simulated = {name: result[name] for name in case.outputs}
    assert max(case.errors(simulated, reported=True).values()) <= OTHER_ROUNDING


@pytest.mark.parametrize("target", VERSIONS)
@pytest.mark.parametrize(
    "name",
    slow_but("all delays", of=["linear axis", "all delays", "element with hysteresis", "friction twice"]),
)
def test_it_is_valid(name: str, target: str, case_named, tmp_path: Path):
    pytest.importorskip("lxml", reason="lxml is not installed (pip install fmpy lxml)")
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(written(case_named(name), tmp_path, target))) == []


def test_a_build_description_is_valid(case_named, tmp_path: Path):
    etree = pytest.importorskip("lxml.etree", reason="lxml is not installed (pip install fmpy lxml)")
    archive = zipfile.ZipFile(written(case_named("linear axis"), tmp_path, "fmu3", source_only=True))
    place = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3BuildDescription.xsd"
    schema = etree.XMLSchema(etree.parse(str(place)))
    schema.assertValid(etree.fromstring(archive.read("sources/buildDescription.xml")))


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


@pytest.mark.parametrize("target", VERSIONS)
def test_the_same_model_gives_the_same_bytes(target: str, case_named):
    model = case_named("backlash").model
    first, second = (export_model(model, target, source="model.json", name="rig") for _ in range(2))
    assert first == second


@pytest.mark.slow
@pytest.mark.parametrize(("target", "others"), [("fmu", []), ("fmu3", ["sources/buildDescription.xml"])])
@pytest.mark.parametrize("name", ["all delays", "axis held constant", "element"])
def test_its_sources_compile_without_a_warning(
    name: str, target: str, others: list[str], case_named, tmp_path: Path
):
    archive = zipfile.ZipFile(written(case_named(name), tmp_path, target, source_only=True))
    wrapper = f"fmi{2 if target == 'fmu' else 3}_rig.c"
    assert sorted(archive.namelist()) == sorted(
        ["modelDescription.xml", f"sources/{wrapper}", "sources/rig.c", *others]
    )
    archive.extractall(tmp_path)
    alone = export_model(case_named(name).model, "c", source="model.json", name="rig")
    assert (tmp_path / "sources" / "rig.c").read_text("utf-8") == alone
    command = [*c_compilers()[0].command, *STRICT, "-o", "rig.so", wrapper, "-lm"]
    run = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_its_binary_is_for_every_processor_of_its_kind(case_named, monkeypatch: pytest.MonkeyPatch):
    used: list[tuple[str, ...]] = []

    def library(_sources, flags):
        used.append(tuple(flags))
        return c_compilers()[0], b"library"

    monkeypatch.setattr("rigsight.export.fmu.first_library", library)
    export_model(case_named("linear axis").model, "fmu", source="model.json", name="rig")
    ((flags),) = used
    assert "-march=native" not in flags
    assert set(flags) < set(kernel_options())


@pytest.mark.parametrize("target", VERSIONS)
def test_without_a_compiler_the_way_out_is_named(target: str, case_named, monkeypatch: pytest.MonkeyPatch):
    model = case_named("linear axis").model
    monkeypatch.setattr("rigsight.libraries.library_cache.c_compilers", lambda: ())
    with pytest.raises(InputError, match=r"No C compiler was found.*--source-only"):
        export_model(model, target, source="model.json")
    monkeypatch.undo()
    monkeypatch.setenv("CC", "false")
    with pytest.raises(InputError, match=r"false failed.*--source-only"):
        export_model(model, target, source="model.json")
