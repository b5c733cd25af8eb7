"""A weight that the simulation lacks is gravity, whatever direction the zero of the angle has, and no torque ripple."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, Family, effect_named, placed
from rigsight.inverse import propose
from rigsight.rigs import RIGS

from .motor_rig import motor_rig
from .test_proposal import campaign

ARM = motor_rig("J*d(q)^2/2")
VALUES = {"J": 0.02, "k_v": 1.0, "d": 0.05}


@pytest.mark.parametrize("zero", [0.0, 0.9, np.pi / 2.0])
def test_it_is_found_with_its_size(zero: float) -> None:
    weight = {"G_s": 0.5 * np.cos(zero), "G_c": 0.5 * np.sin(zero)}
    own = campaign(ARM, {**VALUES, **weight}, [placed(effect_named("gravity_torque"), "gearbox")], (0.6, 0.9))
    found = propose(own, {**own.constants, **own.given}, candidates_on(ARM, CATALOGUE))
    assert found is not None
    assert found.taken[0].family is Family.GRAVITY
    assert np.hypot(*found.taken[0].values.values()) == pytest.approx(0.5, rel=0.05)


def test_only_an_angle_without_a_spring_has_it() -> None:
    gravity = effect_named("gravity_torque")
    assert ARM.offers(placed(gravity, "gearbox"))
    assert RIGS["servo"].offers(placed(gravity, "gearbox"))
    for rig in (RIGS["axis"], RIGS["running_gear"], RIGS["element"]):
        assert not rig.offers(gravity)
    assert not any(
        RIGS["quarter_car"].offers(placed(gravity, j.name)) for j in RIGS["quarter_car"].mechanism.joints
    )
