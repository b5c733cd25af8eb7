"""What the sensors show beside a simulation corrects the motion of every joint, and only where they show all of it."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.pushes.responses import Corrections
from rigsight.rigs import RIGS

DIFFERENCES = np.column_stack([np.linspace(0.0, 1.0, 5), np.linspace(2.0, 1.0, 5)])


def test_two_angles_tell_what_the_shaft_is_twisted_by() -> None:
    corrections = Corrections(RIGS["drive_train"])
    both = {"u", "motor_angle", "load_angle"}
    np.testing.assert_allclose(
        corrections.of_joint("shaft", DIFFERENCES, both), DIFFERENCES[:, 0] - DIFFERENCES[:, 1]
    )
    np.testing.assert_allclose(corrections.of_joint("load_bearing", DIFFERENCES, both), DIFFERENCES[:, 1])


@pytest.mark.parametrize("measured", [{"motor_angle"}, set()])
def test_fewer_sensors_than_coordinates_tell_nothing(measured: set[str]) -> None:
    assert Corrections(RIGS["drive_train"]).of_joint("shaft", DIFFERENCES, measured) is None


def test_a_zero_to_identify_is_no_obstacle() -> None:
    moved = Corrections(RIGS["servo"]).of_joint("gearbox", DIFFERENCES[:, :1], {"angle"})
    np.testing.assert_allclose(moved, DIFFERENCES[:, 0])
