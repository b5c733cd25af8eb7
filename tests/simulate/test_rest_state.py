"""The start of a record when nothing else is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.rigs import RUNNING_GEAR, Rig
from rigsight.simulate import compose, parameter_vector, record_input, rest_state, simulate


@pytest.mark.parametrize("name", ["R", "B", "P", "stiff"])
def test_hysteretic_gear_stays_where_it_rests(name, hysteretic, hysteresis_sets, make_record):
    values = {**hysteresis_sets[name], "psi_off": 2e-3, "y_off": -4e-4}
    simulated = simulate(hysteretic, values, make_record(np.full(1000, 0.3)))
    for signal in ("psi", "y"):
        assert np.ptp(simulated[signal]) <= 1e-8 * abs(simulated[signal][0])


def test_rest_is_on_the_virgin_curve(hysteretic, hysteresis_sets, make_record):
    """Raised slowly from zero, z follows z' = 1 - (beta + gamma) z, without the memory of an overshoot."""
    values = hysteresis_sets["R"]
    held = record_input(hysteretic, make_record(np.full(10, 0.3)))
    state = rest_state(hysteretic, parameter_vector(hysteretic, values), held)
    total = values["beta"] + values["gamma"]
    z = -np.expm1(-total * state[0]) / total
    np.testing.assert_allclose(state[3], z, rtol=1e-6)
    torque = values["k_c"] * (values["a"] * state[0] + (1.0 - values["a"]) * z)
    np.testing.assert_allclose(torque, 0.3 * 0.3 * 0.27 / 0.1, rtol=1e-6)


def test_zero_input_rests_at_the_offsets(hysteretic, hysteresis_sets, make_record):
    values = {**hysteresis_sets["R"], "psi_off": 1e-3, "y_off": 2e-4}
    simulated = simulate(hysteretic, values, make_record(np.zeros(500)))
    np.testing.assert_allclose(simulated["psi"], 1e-3, rtol=1e-12)
    np.testing.assert_allclose(simulated["y"], 2e-4 + 2 * 0.25 * 1e-3, rtol=1e-9)


def test_friction_holds_a_force_within_its_limit(axis_with_friction, axis_values, make_record):
    values = {**axis_values, "T_c": 1.0}
    record = make_record(np.full(300, 0.9))
    assert np.all(simulate(axis_with_friction, values, record)["x"] == 0.0)
    pulled = simulate(axis_with_friction, values, make_record(np.full(300, 3.0)))["x"]
    np.testing.assert_allclose(pulled, 0.02, rtol=1e-4)
    assert np.ptp(pulled) == 0.0


def test_spring_without_end_starts_at_its_offset(axis, axis_values, make_record):
    values = {**axis_values, "k": 0.0, "x_off": 0.4}
    state = rest_state(axis, parameter_vector(axis, values), record_input(axis, make_record(np.ones(5))))
    np.testing.assert_array_equal(state, [0.4, 0.0])


def test_delayed_input_rests_too(axis_with_delay, axis_values, make_record):
    simulated = simulate(axis_with_delay, {**axis_values, "T_d": 50.0}, make_record(np.full(200, 2.0)))["x"]
    np.testing.assert_allclose(simulated, 0.02, rtol=1e-8)


def test_a_chain_of_states_starts_from_exactly_zero(make_record):
    """The input reaches the memory through four states: far below rounding, no switch may be resolved there."""
    structure = compose(
        RUNNING_GEAR,
        [effect_named("bouc_wen_hysteresis"), effect_named("actuator_lag")],
        {"n": 1.0, "A": 1.0},
    )
    values = {
        "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.4, "k_c": 470.0, "k_d": 0.08, "l_0": 0.25, "c_y": 0.98,
        "psi_off": 0.0, "y_off": 0.0, "a": 0.097, "beta": 840.0, "gamma": -29.0, "T_a": 0.038,
    }  # fmt: skip
    time = 5e-3 * np.arange(400)
    psi = simulate(structure, values, make_record(np.sin(5.0 * time)))["psi"]
    near = simulate(structure, {**values, "psi_off": 1e-9}, make_record(np.sin(5.0 * time)))["psi"] - 1e-9
    np.testing.assert_allclose(psi, near, atol=1e-6 * np.std(psi))


@pytest.mark.parametrize("damping", ["", "2*d_0", "d_0"])
def test_it_rests_whatever_its_damping_is_written_as(
    damping: str, mass_on_spring: Callable[..., Rig], make_record
):
    of_damper = ({"d_0": "N s/m"}, {"damping": damping}, {"d_0": 0.5}) if damping else ({}, {}, {})
    units, joint, numbers = of_damper
    rig = mass_on_spring({"k": "N/m", "preload": "N", **units}, stiffness="k", force="preload", **joint)
    structure = compose(rig, [effect_named("coulomb_friction")])
    values = {"m": 1.0, "k": 100.0, "preload": -3.0, "T_c": 0.5, **numbers}
    simulated = simulate(structure, values, make_record(np.full(100, 2.0)))["x"]
    np.testing.assert_allclose(simulated, 0.045, rtol=1e-6)
