"""The exported python-control system, in python-control's own simulation, against the engine."""

from __future__ import annotations

import control
import numpy as np
import pytest

from rigsight.export.targets import export_model

SMOOTH, KINKED = 1e-6, 1e-4
"""A solver that knows no events crosses kinks with the error of its step."""


def system_of(case):
    space = {}
    exec(export_model(case.model, "control", source="model.json", name="rig"), space)
    return space["system"], space["REST"]


def test_it_gives_the_outputs_of_the_engine(solved_case, refused):
    case = solved_case
    if refused(case, "control"):
        pytest.skip("friction and delays are refused, which test_targets.py tests")
    if case.model.hold == "zoh" or case.inputs[0][0] != 0.0 or case.model.structure.rig.mechanism.prescribed:
        pytest.skip("python-control interpolates linearly and starts at rest without input")
    system, rest = system_of(case)
    response = control.input_output_response(
        system, case.t, np.array(case.inputs), rest,
        solve_ivp_kwargs={"method": "DOP853", "rtol": 1e-10, "atol": 1e-14, "max_step": case.t[1] / 4},
    )  # fmt: skip
    simulated = dict(zip(case.outputs, response.outputs.reshape(len(case.outputs), -1), strict=True))
    assert max(case.errors(simulated).values()) <= (SMOOTH if case.smooth else KINKED)


def test_signals_states_and_parameters_have_their_names(case_named):
    system, _ = system_of(case_named("bouc_wen_hysteresis"))
    assert system.input_labels == ["u"]
    assert system.output_labels == ["psi", "y"]
    assert system.state_labels == ["psi", "w", "y", "bouc_wen_hysteresis_z"]
    assert system.params["k_c"] == 81.0


def test_it_can_be_linearized(case_named):
    case = case_named("linear axis")
    system, rest = system_of(case)
    poles = system.linearize(np.array(rest), [0.0]).poles()
    values = case.model.values
    assert np.prod(poles).real == pytest.approx(values["k"] / values["m"], rel=1e-4)


def test_inputs_and_outputs_of_a_larger_rig_have_their_names(case_named):
    system, _ = system_of(case_named("a mass matrix of coordinates"))
    assert system.input_labels == ["tau_1", "tau_2"]
    assert system.output_labels == ["angle_1", "angle_2"]
    assert system.state_labels == ["q_1", "q_2", "d_q_1", "d_q_2"]


def test_a_prescribed_motion_has_two_inputs(case_named):
    case = case_named("element")
    system, _ = system_of(case)
    assert system.input_labels == ["x", "x_rate"]
    force = system.output(0.0, np.zeros(0), [0.1, 2.0])
    assert force[0] == pytest.approx(100.0 * 0.1 + 2.0 * 2.0 + 0.3)
