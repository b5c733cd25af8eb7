"""Simulations of a model for a record start where they are told to, whatever effects the model has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rigsight as rs

AXIS = {"gain": 1.0, "m": 2.0, "d": 3.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
T = 0.01 * np.arange(400)


@pytest.mark.parametrize(("effect", "constant"), [("actuator_lag", "T_a"), ("sensor_lag", "T_m")])
@pytest.mark.parametrize("start", [{"w": 0.0}, "estimated"])
def test_a_lag_without_a_time_constant_starts_like_none(effect: str, constant: str, start: Any) -> None:
    pushed = rs.Record("pushed", 0.01, {"u": 4.0 + np.sin(9.0 * T)}, {"u": "N"})
    measured = rs.simulate_model(rs.make_model("axis", AXIS), pushed)
    quick = rs.make_model("axis", {**AXIS, constant: 0.0}, [effect])
    simulated = rs.simulate_model(quick, measured, start)
    np.testing.assert_allclose(simulated["x"], measured["x"], atol=1e-5)


def test_a_state_of_a_vanished_effect_may_be_given() -> None:
    pushed = rs.Record("pushed", 0.01, {"u": np.sin(9.0 * T)}, {"u": "N"})
    quick = rs.make_model("axis", {**AXIS, "T_a": 0.0}, ["actuator_lag"])
    start = {"actuator_lag.u_a": 1.0, "x": 1e-3}
    plain = rs.simulate_model(rs.make_model("axis", AXIS), pushed, {"x": 1e-3})
    np.testing.assert_array_equal(rs.simulate_model(quick, pushed, start)["x"], plain["x"])


def test_an_input_in_another_unit_is_converted_with_a_note() -> None:
    model = rs.make_model("element", {"d": 20.0, "k": 3e3, "force_off": 0.0})
    in_meters = rs.Record("pulled", 0.01, {"x": 5e-3 * np.sin(9.0 * T)}, {"x": "m"})
    in_millimeters = rs.Record("pulled", 0.01, {"x": 5.0 * np.sin(9.0 * T)}, {"x": "mm"})
    simulated = rs.simulate_model(model, in_millimeters)
    np.testing.assert_allclose(simulated["force"], rs.simulate_model(model, in_meters)["force"], rtol=1e-12)
    assert any("converted from mm" in note for note in simulated.notes)
