"""How far does a motion travel, with sensors that show its position and with others?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.identify import characteristic_scales
from rigsight.records import Record

from ...inverse.motor_rig import TEXT, motor_rig, rig_of_text

KINETIC = "J*d(q)^2/2"
VALUES = {"J": 0.01, "k_v": 1.0, "d": 0.1}
SPEED = TEXT.replace(
    '[sensors.angle]\nreads = "q"\nunit = "rad"', '[sensors.speed]\nreads = "d(q)"\nunit = "rad/s"'
)


@pytest.mark.parametrize(("sensor", "travel"), [("angle", 8.0), ("speed", 5.0)])
def test_records_whose_positions_are_not_known_to_each_other_are_not_added(
    sensor: str, travel: float
) -> None:
    t = 0.01 * np.arange(501)
    rig = motor_rig(KINETIC)
    if sensor == "speed":
        rig = rig_of_text(SPEED.format(kinetic=KINETIC, potential="0", constants=""), "motor.toml")
    records = []
    for name, rate in (("forward", 1.0), ("back", -0.6)):
        reading = rate * t if sensor == "angle" else np.full(t.size, rate)
        records.append(Record(name, 0.01, {"u": np.full(t.size, 0.1 * rate), sensor: reading}, {}))
    found = characteristic_scales(rig, records, VALUES)
    assert found["travel@gearbox"] == pytest.approx(travel, rel=0.1)
