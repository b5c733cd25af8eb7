"""A rig that nothing brings back is told from one that has a spring, a weight or a control loop."""

from __future__ import annotations

import pytest

from rigsight.rigs import RIGS
from rigsight.simulate.drift import can_drift


@pytest.mark.parametrize("name", ["drive_train", "servo", "two_link_arm", "quarter_car"])
def test_springs_weights_and_control_loops_bring_a_rig_back(name: str) -> None:
    assert not can_drift(RIGS[name], {})


def test_a_cart_rolls_away() -> None:
    assert can_drift(RIGS["cart_pendulum"], {})


def test_a_spring_that_is_given_as_zero_is_none() -> None:
    assert can_drift(RIGS["drive_train"], {"k_l": 0.0})
    assert not can_drift(RIGS["drive_train"], {"k_s": 0.3, "k_l": 0.1})
