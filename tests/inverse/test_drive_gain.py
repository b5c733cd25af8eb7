"""Does a known weight give the gain of the drive that works against it, beside whatever is missing?"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named
from rigsight.inverse import propose
from rigsight.inverse.drive_gain import changed, gains_of_known_scale, slopes_of_changes
from rigsight.rigs import RIGS

from .motor_rig import motor_rig
from .test_proposal import campaign

WEIGHED = """
[constants.m]
unit = "kg"
[constants.l]
unit = "m"
"""
SERVO = motor_rig("(J + m*l^2)*d(q)^2/2", "-m*9.81*l*cos(q)", WEIGHED)
PAYLOAD = {"m": 0.5, "l": 0.1}
VALUES = {**PAYLOAD, "J": 2e-3, "k_v": 0.6, "d": 0.02}


@pytest.mark.parametrize(
    ("missing", "values", "given"),
    [
        ("coulomb_friction", {"T_c": 0.05}, 0.3),
        ("coulomb_friction", {"T_c": 0.05}, 1.2),
        ("torque_ripple", {"T_sin": 0.1, "T_cos": 0.0, "kappa": 9.0}, 1.2),
    ],
)
def test_what_is_missing_and_the_gain_are_found_from_any_given_gain(
    missing: str, values: Mapping[str, float], given: float
) -> None:
    own = campaign(SERVO, {**VALUES, **values}, [effect_named(missing)], (0.3, 0.5))
    known = {**PAYLOAD, "J": 1e-3, "k_v": given, "d": 0.05}
    found = propose(own, known, candidates_on(SERVO, CATALOGUE))
    assert found is not None
    assert found.taken[0].family == effect_named(missing).family
    assert found.numbers["k_v"] == pytest.approx(VALUES["k_v"], rel=0.02)
    assert found.numbers["J"] == pytest.approx(VALUES["J"], rel=0.05)


def test_without_a_known_weight_the_gain_sets_the_scale() -> None:
    assert gains_of_known_scale(RIGS["axis"]) == {}
    assert gains_of_known_scale(RIGS["running_gear"]) == {}


def test_numbers_follow_from_residuals_in_units_of_the_input() -> None:
    start, is_gain = np.array([0.5, 2.0]), [True, False]
    # Twice the reciprocal of the gain: all forces are half as large.
    assert changed(start, np.array([-0.5, 0.0]), is_gain) == pytest.approx([0.25, 2.0])
    assert changed(start, np.array([-0.5, 2.0]), is_gain) == pytest.approx([0.25, 3.0])
    assert changed(start, np.array([0.6, 0.1]), is_gain) == pytest.approx([0.5, 2.1]), "no sign"


def test_the_slopes_of_changes_are_those_of_the_numbers_backwards() -> None:
    start, change, is_gain = np.array([0.5, 2.0, 3.0]), np.array([0.2, 0.4, -0.3]), [True, False, False]
    found = changed(start, change, is_gain)
    steps = 1e-6 * np.eye(3)
    forward = np.array([(changed(start, change + step, is_gain) - found) / 1e-6 for step in steps]).T
    assert slopes_of_changes(start, found, is_gain) @ forward == pytest.approx(np.eye(3), abs=1e-4)
