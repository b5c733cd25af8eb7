"""What happened before a record: memory of hysteresis and delay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from rigsight.records.record import Hold, Record
from rigsight.simulate import Structure, simulate

SPLIT = 777


@pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])
def test_motion_before_a_record_is_remembered(
    hold: Hold, hysteretic: Structure, hysteresis_sets: Mapping[str, Mapping[str, float]]
) -> None:
    t = np.arange(2000) * 5e-3
    whole = Record("whole", 5e-3, {"u": np.sin(3.0 * t) + 0.4 * np.sin(11.0 * t)}, {}, hold=hold)
    expected = simulate(hysteretic, hysteresis_sets["R"], whole)
    second = replace(whole, signals={"u": whole["u"][SPLIT:]}, t0=SPLIT * whole.dt)
    continued = simulate(hysteretic, hysteresis_sets["R"], second, before=whole["u"][:SPLIT])
    np.testing.assert_array_equal(continued["psi"], expected["psi"][SPLIT:])
    forgotten = simulate(hysteretic, hysteresis_sets["R"], second)
    assert np.std(forgotten["psi"][:100] - continued["psi"][:100]) > 1e-2 * np.std(continued["psi"])


def test_a_delay_reaches_back_before_the_record(
    axis_with_delay: Structure, axis_values: Mapping[str, float]
) -> None:
    values = {**axis_values, "T_d": 0.1}
    record = Record("rest", 5e-3, {"u": np.zeros(200)}, {}, hold="zoh")
    pulse = np.zeros(40)
    pulse[-20:] = 1.0
    assert np.max(np.abs(simulate(axis_with_delay, values, record, before=pulse)["x"])) > 1e-3
    assert np.max(np.abs(simulate(axis_with_delay, values, record)["x"])) < 1e-12
