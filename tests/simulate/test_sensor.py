"""Late and slow sensors against what they are by definition."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import compose, simulate

GEAR = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip


@pytest.fixture
def swept(make_record):
    time = 5e-3 * np.arange(2000)
    return make_record(np.sin(3.0 * time + 1.2 * time**2))


@pytest.mark.parametrize("delay", [0.0123, 0.035, 5e-3])
def test_a_late_sensor_of_an_axis_is_a_late_input(delay, axis_values, swept):
    late_sensor = simulate(
        compose(AXIS, [effect_named("sensor_delay")]), {**axis_values, "T_s": delay}, swept
    )
    late_input = simulate(compose(AXIS, [effect_named("input_delay")]), {**axis_values, "T_d": delay}, swept)
    error = late_sensor["x"] - late_input["x"]
    assert np.std(error) <= 2e-4 * np.std(late_input["x"])


def test_interpolation_is_of_fourth_order(axis_values, make_record):
    errors = []
    for dt in (0.02, 0.01, 0.005):
        record = make_record(np.sin(6.0 * dt * np.arange(round(8.0 / dt))), dt=dt)
        structure = compose(AXIS, [effect_named("sensor_delay")])
        late = simulate(structure, {**axis_values, "T_s": 0.5 * dt + 0.04}, record, accuracy=1e-10)["x"]
        fine = make_record(np.sin(6.0 * dt * np.arange(round(8.0 / dt))), dt=dt)
        exact = simulate(
            compose(AXIS, [effect_named("input_delay")]),
            {**axis_values, "T_d": 0.5 * dt + 0.04},
            fine,
            accuracy=1e-10,
        )["x"]
        errors.append(np.max(np.abs(late - exact)[round(4.0 / dt) :]))
    assert errors[0] > 10.0 * errors[1] > 100.0 * errors[2] * 0.9


def test_a_late_or_slow_sensor_leaves_the_lateral_motion_alone(swept):
    plain = simulate(compose(RUNNING_GEAR), GEAR, swept)
    for name, values in (("sensor_delay", {"T_s": 0.03}), ("sensor_lag", {"T_m": 0.03})):
        seen = simulate(compose(RUNNING_GEAR, [effect_named(name)]), {**GEAR, **values}, swept)
        np.testing.assert_allclose(seen["y"], plain["y"], atol=1e-6 * np.std(plain["y"]))
        assert np.std(seen["psi"] - plain["psi"]) > 0.05 * np.std(plain["psi"])


def test_a_slow_sensor_of_a_linear_axis_is_a_slow_actuator(axis_values, swept):
    slow_sensor = simulate(compose(AXIS, [effect_named("sensor_lag")]), {**axis_values, "T_m": 0.04}, swept)
    slow_actuator = simulate(
        compose(AXIS, [effect_named("actuator_lag")]), {**axis_values, "T_a": 0.04}, swept
    )
    np.testing.assert_allclose(slow_sensor["x"], slow_actuator["x"], atol=1e-5 * np.std(slow_actuator["x"]))
