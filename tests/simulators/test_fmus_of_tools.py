"""FMUs of other tools, PythonFMU and OpenModelica: the same mass on a spring, by Model Exchange and co-simulation."""

from __future__ import annotations

import importlib.util
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmpy import platform

from rigsight.errors import InputError
from rigsight.rigs.reading.rig_file import rig_of_text

RIG = """
name = "oscillator"
[inputs.u]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.c]
unit = "N s/m"
[coordinates.x]
unit = "m"
[joints.guide]
motion = "x"
[drives.coil]
signal = "u"
force = "coil"
along = "x"
[sensors.travel]
reads = "x"
unit = "m"
[simulator]
kind = "fmu"
file = "FILE"
[simulator.coordinates]
x = "damper.s_rel"
[simulator.rates]
x = "damper.v_rel"
[simulator.forces]
x = "-f"
[simulator.parameters]
m = "mass.m"
k = "spring.c"
c = "damper.d"
"""
SLAVE = """
from {package} import Fmi{v}Causality as C, Fmi{v}Initial as I, Fmi{v}Slave, Fmi{v}Variability as V, {number}

class Oscillator(Fmi{v}Slave):
    def __init__(self, **given):
        super().__init__(**given)
        self.time, self.travel, self.speed, self.f, self.m, self.k, self.c = 0.0, 1.0, 0.0, 0.0, 1.0, 1e4, 10.0
        if {v} == 3:
            self.register_variable({number}("time", causality=C.independent, variability=V.continuous))
        for name in ("travel", "speed"):
            start = {{"start": getattr(self, name)}} if {v} == 3 else {{}}
            own = {number}(name, causality=C.output, variability=V.continuous, initial=I.exact, **start)
            self.register_variable(own)
        self.register_variable({number}("f", causality=C.input))
        for name in "mkc":
            self.register_variable({number}(name, causality=C.parameter, variability=V.tunable))

    def do_step(self, time, step):
        a = (-self.f - self.k * (self.travel - 1.0) - self.c * self.speed) / self.m
        self.travel += step * (self.speed + 0.5 * step * a)
        self.speed += step * a
        return True
"""
NAMES = {"damper.s_rel": "travel", "damper.v_rel": "speed", "mass.m": "m", "spring.c": "k", "damper.d": "c"}
OF_PYTHON = {"pythonfmu": (2, "Real"), "pythonfmu3": (3, "Float64")}


def forces_and_masses(text: str, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    answers = rig_of_text(text, folder=folder).mechanism.bodies.answers
    x, v, m, k, c = places = np.random.default_rng(0).uniform(0.5, 2.0, (5, 20))
    np.testing.assert_allclose(answers.at(places[[0, 2, 3, 4]], is_force=False)[0], m, rtol=1e-6)
    return answers.at(places, is_force=True)[0], -k * (x - 1.0) - c * v


@pytest.mark.parametrize("package", OF_PYTHON)
def test_an_fmu_of_pythonfmu(package, tmp_path):
    pytest.importorskip(package)
    if platform not in ("linux64", "win64"):
        pytest.skip(f"{package} has no binary for {platform}")
    builder = importlib.import_module(f"{package}.builder").FmuBuilder
    version, number = OF_PYTHON[package]
    # PythonFMU imports scripts by their names, of all FMUs of a process.
    script = tmp_path / f"oscillator_of_{package}.py"
    script.write_text(SLAVE.format(package=package, v=version, number=number), encoding="utf-8")
    builder.build_FMU(script, dest=tmp_path, canHandleVariableCommunicationStepSize=True)
    text = RIG.replace("FILE", "Oscillator.fmu")
    for there, here in NAMES.items():
        text = text.replace(there, here)
    found, wanted = forces_and_masses(text, tmp_path)
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_an_fmu_of_openmodelica(kind, tmp_path):
    found = importlib.util.find_spec("gemseo_fmu")
    if found is None or platform != "linux64":
        pytest.skip(
            "FMUs of OpenModelica are in the Python package gemseo-fmu: pip install --no-deps gemseo-fmu (Linux)"
        )
    path = Path(found.submodule_search_locations[0], "problems", "fmu_files", "linux", "Mass_Damper.fmu")
    other = {"ModelExchange": "CoSimulation", "CoSimulation": "ModelExchange"}[kind]
    with zipfile.ZipFile(path) as whole, zipfile.ZipFile(tmp_path / "one.fmu", "w") as fmu:
        for name in whole.namelist():
            content = whole.read(name)
            if name == "modelDescription.xml":
                description = ET.fromstring(content)
                description.remove(description.find(other))
                content = ET.tostring(description)
            fmu.writestr(name, content)
    text = RIG.replace("FILE", "one.fmu")
    forces, wanted = forces_and_masses(text, tmp_path)
    np.testing.assert_allclose(forces, wanted, rtol=1e-6, atol=1e-6)
    with pytest.raises(InputError, match="no mass matrix can be derived"):
        forces_and_masses(text.replace('"-f"', '"f"'), tmp_path)
