"""Which drive effects does the regression along the motion judge, and which does a free gain hide from it?"""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, effect_named, kind_of
from rigsight.inverse import propose

from .motor_rig import motor_rig
from .test_drive_gain import PAYLOAD, SERVO
from .test_proposal import campaign

MOTOR = motor_rig("J*d(q)^2/2")
VALUES = {"J": 2e-3, "k_v": 0.6, "d": 0.02}


@pytest.mark.parametrize(
    ("effect", "own", "family"),
    [
        ("coasting_bridge", {"c_b": 0.15}, "damping_law"),
        ("speed_limit", {"u_s": 0.5, "c_u": 0.05}, "drive_limit"),
    ],
)
def test_what_a_drive_loses_with_its_speed_is_found(
    effect: str, own: Mapping[str, float], family: str
) -> None:
    records = campaign(MOTOR, {**VALUES, **own}, [effect_named(effect)], (0.4, 0.8))
    found = propose(records, {**records.constants, **records.given}, candidates_on(MOTOR, CATALOGUE))
    assert found is not None
    assert found.taken[0].family == family
    assert found.taken[0].share > 0.8


def test_a_limit_beside_a_gain_of_its_drive_is_left_to_fits() -> None:
    limit = effect_named("input_saturation")
    records = campaign(SERVO, {**VALUES, **PAYLOAD, "u_max": 0.4}, [limit], (0.3, 0.8))
    found = propose(records, {**records.constants, **records.given}, candidates_on(SERVO, CATALOGUE))
    assert found is not None
    assert {"input_saturation", "speed_limit"} <= set(map(kind_of, found.undecided))
    assert not found.undecided & found.judged
