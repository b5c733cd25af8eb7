"""A rig that nothing brings back is told from one that has a spring, a weight or a control loop."""

from __future__ import annotations

import pytest

from rigsight.rigs import RIGS
from rigsight.simulate.equilibrium import can_drift

ROLLS_AWAY = {"cart_pendulum"}


@pytest.mark.parametrize("name", RIGS)
def test_springs_weights_and_control_loops_bring_a_rig_back_and_a_cart_rolls_away(name: str) -> None:
    assert can_drift(RIGS[name], {}) == (name in ROLLS_AWAY)


def test_a_spring_that_is_given_as_zero_is_none() -> None:
    assert can_drift(RIGS["drive_train"], {"k_l": 0.0})
    assert not can_drift(RIGS["drive_train"], {"k_s": 0.3, "k_l": 0.1})
