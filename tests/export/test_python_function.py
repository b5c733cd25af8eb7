"""The exported Python function against the engine."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigsight.export.targets import export_model
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose, rest_state
from rigsight.simulate import simulate as simulate_engine
from rigsight.simulate.input_hold import hold_input
from rigsight.simulate.model import Model


def module_of(text: str) -> dict[str, Any]:
    space: dict[str, Any] = {}
    exec(compile(text, "exported.py", "exec"), space)
    return space


def exported(case, **options) -> dict[str, Any]:
    return module_of(export_model(case.model, "python", source="model.json", **options))


def test_it_gives_the_outputs_of_the_engine(case, refused):
    if refused(case, "python"):
        pytest.skip("several frictions are refused, which test_targets.py tests")
    simulated = exported(case)["simulate"](case.t, *case.inputs)
    assert tuple(simulated) == case.outputs
    assert max(case.errors(simulated).values()) <= 1e-6


def test_it_needs_numpy_and_nothing_else(case_named, tmp_path: Path):
    text = export_model(case_named("backlash").model, "python", source="model.json")
    (tmp_path / "gear.py").write_text(text, encoding="utf-8")
    script = (
        "import sys, gear\n"
        "y = gear.simulate([0.0, 0.01, 0.02], [0.0, 1.0, 1.0])\n"
        "print(sorted(y), any(name.split('.')[0] in ('rigsight', 'scipy', 'sympy') for name in sys.modules))\n"
    )
    run = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == "['psi', 'y'] False"


def test_half_the_step_gives_a_sixteenth_of_the_error(case_named):
    case = case_named("cubic_stiffness")
    coarse, fine = (
        max(case.errors(exported(case, step=step)["simulate"](case.t, *case.inputs)).values())
        for step in (0.002, 0.001)
    )
    assert 10.0 < coarse / fine < 25.0


def test_numbers_and_states_can_be_replaced(case_named):
    case = case_named("cubic_stiffness")
    simulate = exported(case)["simulate"]
    still = np.zeros_like(case.t)
    softer = simulate(case.t, case.inputs[0], parameters={"k_3": 0.0})
    linear = exported(case_named("linear running gear"))["simulate"](case.t, case.inputs[0])
    np.testing.assert_allclose(softer["psi"], linear["psi"], rtol=0, atol=1e-6 * np.std(linear["psi"]))
    assert simulate(case.t, still, initial_state=[0.01, 0.0, 0.0])["psi"][0] == 0.01
    assert np.all(simulate(case.t, still)["psi"] == 0.0)


def test_the_head_tells_source_equations_and_units(case_named):
    text = export_model(case_named("backlash").model, "python", source="stage/model.json")
    for part in (
        "stage/model.json",
        "abs(backlash_z) <= g",
        "input u [A]",
        "# [N m/rad] equivalent yaw stiffness",
    ):
        assert part in text


def test_unequal_times_are_refused(case_named):
    with pytest.raises(ValueError, match="equally spaced"):
        exported(case_named("linear axis"))["simulate"]([0.0, 1.0, 1.5], [0.0, 0.0, 0.0])


def test_where_friction_holds_what_the_inputs_left_a_start_under_load_is_asked_for(case_named):
    case = case_named("friction at a load")
    simulate, structure = exported(case)["simulate"], case.model.structure
    pushed = case.inputs[0] + 0.2
    with pytest.raises(ValueError, match=r"known only for zero inputs.*initial_state"):
        simulate(case.t, pushed)
    start = [0.02, 0.005, 0.0, 0.0]
    record = Record("pushed", case.t[1], {"u": pushed}, {"u": "A"}, hold=case.model.hold)
    truth = simulate_engine(structure, case.model.values, record, np.array(start), accuracy=1e-9)
    simulated = simulate(case.t, pushed, initial_state=start)
    for name in case.outputs:
        assert np.linalg.norm(simulated[name] - truth[name]) <= 1e-6 * np.linalg.norm(truth[name])


def test_an_equilibrium_under_load_is_that_of_the_engine(case_named):
    case = case_named("a saturated control law")
    structure, first = case.model.structure, 0.3
    p = np.array([case.model.values[name] for name in structure.names])
    expected = rest_state(structure, p, hold_input(np.full(2, first), 1.0, "foh"))
    module = exported(case)
    assert module["_rest"](module["PARAMETERS"], [first]) == pytest.approx(
        expected.tolist(), rel=1e-9, abs=1e-12
    )


def test_a_rig_without_a_damper_starts_where_the_engine_does(mass_on_spring: Callable[..., Rig]):
    values = {"m": 1.0, "k": 100.0}
    model = Model(compose(mass_on_spring({"k": "N/m"}, stiffness="k")), values, "foh")
    record = Record(name="pulled", dt=0.01, signals={"u": 2.0 + np.sin(np.arange(100.0))}, units={"u": "N"})
    simulated = module_of(export_model(model, "python", source="model.json"))["simulate"](
        0.01 * np.arange(100), record["u"]
    )
    expected = simulate_engine(model.structure, values, record)["x"]
    assert expected[0] == pytest.approx(0.02, rel=1e-6)
    np.testing.assert_allclose(simulated["x"], expected, atol=1e-6 * np.ptp(expected))
