"""The motion of a late sensor is read ahead by its delay, so that an observer follows the motion itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.effects import effect_named, placed
from rigsight.records import Record
from rigsight.rigs import RIGS
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    record_values,
    simulate,
    simulate_outputs,
    structure_of_fit,
)
from rigsight.simulate.input_hold import hold_input, hold_motion, together

DT = 0.005
T = DT * np.arange(4000)
VALUES = {"g": 9.81, "m_c": 0.5, "m_p": 0.5, "s": 0.6, "I_p": 0.5, "k_u": 2.0, "d_c": 0.4, "d_p": 0.1}


@pytest.mark.parametrize("by", [0.013, -0.024, DT, 0.0])
def test_an_input_is_read_ahead_beside_another_that_stays(by: float) -> None:
    other = hold_input(np.cos(3.0 * T), DT, "band_limited")
    motion = hold_motion(np.sin(5.0 * T), 5.0 * np.cos(5.0 * T), DT)
    read = together([other, motion]).read_ahead(1, by)
    value, rate = read.at_samples(T.size)[:6].reshape(2, 3, -1)[1, :2]
    # Beyond the end only the third derivative is missing.
    np.testing.assert_allclose(value, np.sin(5.0 * (T + by)), atol=max(1e-7, 125.0 * abs(by) ** 3 / 6.0))
    inside = (T + by >= 0.0) & (T + by <= T[-1])
    np.testing.assert_allclose(value[inside], np.sin(5.0 * (T + by))[inside], atol=1e-7)
    np.testing.assert_allclose(rate[inside], 5.0 * np.cos(5.0 * (T + by))[inside], atol=1e-5)
    np.testing.assert_array_equal(
        read.at_samples(T.size)[:3], together([other, motion]).at_samples(T.size)[:3]
    )


@pytest.mark.parametrize(("name", "own"), [("sensor_delay", "T_s"), ("time_shift", "T_x")])
@pytest.mark.parametrize("sensor", ["cart", "angle"])
def test_an_observer_of_a_late_sensor_leaves_nothing(name: str, own: str, sensor: str) -> None:
    rig = RIGS["cart_pendulum"]
    u = 0.2 * sum(np.sin(w * T + w) for w in (1.0, 2.5, 4.0, 6.5))
    record = Record("multisine", DT, {"u": u}, {"u": "A"}, hold="band_limited")
    structure = compose(rig, [placed(effect_named(name), sensor)])
    values = {**VALUES, own: 0.024}
    measured = simulate(structure, values, record, np.zeros(len(structure.states)), accuracy=1e-9)
    followed = replace(measured, observed={"cart": 3.0, "angle": 3.0})
    observer = structure_of_fit(structure, [followed])
    out = simulate_outputs(
        observer,
        record_input(observer, followed),
        parameter_vector(observer, record_values(observer, values, followed)),
        np.zeros(len(observer.states)),
        T.size,
        1e-9,
    )
    error = out - np.column_stack([measured["cart"], measured["angle"]])
    # From zero to one delay nobody knows what was before, at the end what will be after.
    settled = slice(200, -200)
    assert np.std(error[settled], axis=0) == pytest.approx(0.0, abs=3e-6)
    assert np.std(measured["angle"]) > 0.01
