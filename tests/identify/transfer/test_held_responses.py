"""Samples of a response that falls off slowly show what a held input does above Nyquist."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete

from rigsight.frequency.signal_pair import hold_response
from rigsight.identify.linear_view import images_of_held_input
from rigsight.records import Hold, Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose
from rigsight.simulate.linearization import linearize

CAR = """
name = "car"
summary = "A mass whose speed is shown."
[inputs.u]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.d]
unit = "N s/m"
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.road]
motion = "x"
damping = "d"
[drives.push]
signal = "u"
force = "push"
along = "x"
[sensors.speed]
reads = "d(x)"
unit = "m/s"
"""
DT = 0.01


@pytest.mark.parametrize(("hold", "method"), [("zoh", "zoh"), ("foh", "foh")])
def test_the_response_of_a_speed_is_that_of_the_sampled_rig(hold: Hold, method: str) -> None:
    linear = linearize(compose(rig_of_text(CAR, "car.toml")), {"m": 2.0, "d": 3.0})
    omega = np.linspace(5.0, 250.0, 40)
    record = Record("r", DT, {"u": np.zeros(10), "speed": np.zeros(10)}, {}, hold=hold)
    a, b, c, d, _ = cont2discrete(tuple(np.array([[e]]) for e in (-1.5, 0.5, 1.0, 0.0)), DT, method)
    z = np.exp(1j * omega * DT)
    exact = (c[0, 0] * b[0, 0] / (z - a[0, 0]) + d[0, 0]) / hold_response(omega, DT, hold)
    plain = linear.frequency_response(omega)[:, 0, 0]
    images = images_of_held_input(linear, omega, [record])[:, 0, 0]
    np.testing.assert_allclose(plain + images, exact, atol=0.03 * float(np.max(np.abs(exact - plain))))
    assert np.all(
        images_of_held_input(linear, omega, [record, Record("s", 2.0 * DT, record.signals, {}, hold=hold)])
        == 0.0
    )
