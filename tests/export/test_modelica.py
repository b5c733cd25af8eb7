"""The exported Modelica text: its structure, and its motion in a Modelica compiler where one is installed."""

from __future__ import annotations

import re

import numpy as np
import pytest

from rigsight.export.targets import export_model
from rigsight.records import Record
from rigsight.simulate import simulate

DT = 1e-3


def text_of(case) -> str:
    text = export_model(case.model, "modelica", source="model.json", name="Rig")
    assert isinstance(text, str)
    return text


def test_each_unknown_has_one_equation_and_each_state_a_start(case, refused):
    if refused(case, "modelica"):
        pytest.skip("what sticks is refused, which test_targets.py tests")
    text = text_of(case)
    head, _, body = text.partition("\nequation\n")
    declared = re.findall(r"^  (?:output )?Real (\w+)", head, re.MULTILINE)
    states = re.findall(r"der\((\w+)\) =", body)
    given = states + re.findall(r"^  (\w+) =", body, re.MULTILINE)
    assert sorted(given) == sorted(declared)
    assert states == [
        line.split()[-1]
        for line in re.findall(r"^  (?:output )?Real \w+(?=.*fixed=true)", head, re.MULTILINE)
    ]
    assert text.startswith('model Rig "')
    assert text.endswith("end Rig;\n")


def test_parameters_carry_their_units(case_named):
    text = text_of(case_named("cubic_stiffness"))
    assert 'parameter Real k_3(unit="N.m/rad3") = 300000.0 "cubic stiffness [N m/rad^3]";' in text
    assert 'input Real u(unit="A") "motor current [A]";' in text


def test_an_output_like_a_state_is_that_state(case_named):
    assert re.search(r"output Real psi\(.*fixed=true", text_of(case_named("backlash")))
    assert "output Real psi_measured" in text_of(case_named("sensor_delay"))


def test_it_moves_as_in_the_engine(case, refused):
    rumoca = pytest.importorskip("rumoca", reason="no Modelica compiler is installed (pip install rumoca)")
    structure = case.model.structure
    if (
        refused(case, "modelica")
        or structure.rig.mechanism.prescribed
        or len(case.inputs) != 1
        or case.inputs[0][0] != 0.0
        or case.model.hold == "zoh"
    ):
        pytest.skip("the compiler takes inputs as formulas only")
    if structure.delay is not None or structure.first_shown_late is not None:
        pytest.skip("this compiler approximates delays")
    source = structure.rig.inputs[0].name
    drive = "sin(2*time + 1.5*time*time)"
    text = (
        text_of(case)
        .replace(f"  input Real {source}(", f"  Real {source}(")
        .replace("\nequation\n", f"\nequation\n  {source} = {drive};\n")
    )
    model = rumoca.Session().loads(text, model="Rig")
    result = model.simulate(t=(0.0, 2.0), dt=0.01, config=rumoca.SimConfig(rtol=1e-10, atol=1e-13))
    t = DT * np.arange(2001)
    u = np.sin(2.0 * t + 1.5 * t * t)
    record = Record(name="sweep", dt=DT, signals={source: u}, units={source: "A"})
    truth = simulate(structure, case.model.values, record)[case.outputs[0]]
    measured = f"{case.outputs[0]}_measured"
    own = measured if measured in text else case.outputs[0]
    at = np.array(result["time"])
    error = np.array(result[own]) - np.interp(at, t, truth)
    assert np.linalg.norm(error) <= 1e-4 * np.linalg.norm(np.interp(at, t, truth))
