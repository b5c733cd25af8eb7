"""A rig file need not say that a mass is positive: its start is found all the same."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.identify import linear_start
from rigsight.records.record import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

CARTS = """
name = "carts"
summary = "Two carts and a spring between them; nothing says that m is above zero."
[inputs.f]
unit = "N"
[parameters.m]
unit = "kg"
[parameters.k]
unit = "N/m"
[parameters.c]
unit = "N/m"
[parameters.d]
unit = "N s/m"
[coordinates.x]
unit = "m"
[coordinates.y]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2 + m*d(y)^2"
[joints.first]
motion = "x"
stiffness = "k"
damping = "d"
[joints.between]
motion = "x - y"
stiffness = "c"
damping = "d"
[drives.motor]
signal = "f"
force = "motor"
along = "x"
[sensors.x_seen]
reads = "x"
unit = "m"
[sensors.y_seen]
reads = "y"
unit = "m"
"""


@pytest.mark.slow
def test_a_mass_without_a_bound_starts_above_zero() -> None:
    rig = rig_of_text(CARTS)
    values = {"m": 2.0, "k": 40.0, "c": 20.0, "d": 1.0}
    t = 0.01 * np.arange(2000)
    run = Record("run", 0.01, {"f": np.sin(2.0 * t + 0.2 * t**2)}, {}, role="estimation")
    shown = simulate(compose(rig), values, run)
    rng = np.random.default_rng(0)
    noisy = {s.name: shown[s.name] + 1e-4 * rng.standard_normal(t.size) for s in rig.outputs}
    assert linear_start(rig, [shown.with_signals(**noisy)], {}, {}) == pytest.approx(values, rel=0.02)
