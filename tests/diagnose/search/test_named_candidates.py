"""Candidates that a user names are all fitted, also those that the motion rules out."""

from __future__ import annotations

from rigsight.diagnose.diagnosis import diagnose
from rigsight.effects import effect_named, placed

from ...inverse.motor_rig import motor_rig
from ...inverse.test_proposal import campaign

MOTOR = motor_rig("J*d(q)^2/2 + 0.05*d(q)^2")
VALUES = {"J": 0.05, "k_v": 1.0, "d": 0.1, "T_c": 0.2}
NAMED = [placed(effect_named(name), "gearbox") for name in ("coulomb_friction", "quadratic_damping")]


def test_a_named_effect_is_a_candidate_whatever_the_motion_says_of_it() -> None:
    own = campaign(MOTOR, VALUES, NAMED[:1], (0.6, 0.9))
    found = diagnose(own, NAMED)
    assert {("coulomb_friction@gearbox",), ("quadratic_damping@gearbox",)} <= {
        c.effects for c in found.candidates
    }
    assert found.effects == ("coulomb_friction@gearbox",)
