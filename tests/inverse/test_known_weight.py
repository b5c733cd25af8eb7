"""Does a known weight that falls give the inertia and the damping that it moves, where no drive does?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.inverse import numbers_along_motion
from rigsight.records import Record
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate
from rigsight.workflow.campaign.in_memory import make_campaign

FALL = rig_of_text(
    """
name = "fall"
summary = "A weight at a horn turns a gear train back."
[constants.m]
unit = "kg"
[constants.r]
unit = "m"
[parameters.I]
unit = "kg m^2"
lower = 1e-9
log = true
[parameters.b]
unit = "N m s/rad"
lower = 0.0
[coordinates.phi]
unit = "rad"
[energy]
kinetic = "(I + m*r^2)*d(phi)^2/2"
potential = "-9.81*m*r*cos(phi)"
[joints.gear]
motion = "phi"
damping = "b"
[sensors.angle]
reads = "phi"
unit = "rad"
""",
    "fall.toml",
)
WEIGHT = {"m": 0.2, "r": 0.02}
TRUTH = {"I": 1e-3, "b": 5e-3}


def test_inertia_and_damping_follow_from_the_weight() -> None:
    structure, values = compose(FALL), {**WEIGHT, **TRUTH}
    still = Record("fall", 0.005, {"angle": np.zeros(400)}, {})
    record = simulate(structure, values, still, np.array([-2.2, 0.0]))
    campaign = make_campaign(FALL, [record], constants=WEIGHT)
    found = numbers_along_motion(campaign, WEIGHT)
    assert found == pytest.approx(TRUTH, rel=0.02)
