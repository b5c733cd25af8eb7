"""A hidden effect keeps its form whatever its strength."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.blind.strength import draw_shape, scaled
from rigsight.effects import effect_named

SCALES = {"x": 0.1, "time": 0.05, "force": 2.0, "input": 1.0, "drive": 2.0}


@pytest.mark.parametrize("seed", range(5))
def test_static_friction_stays_above_sliding_friction_at_the_limit(seed: int) -> None:
    stribeck = effect_named("stribeck_friction")
    shape = draw_shape(stribeck, SCALES, np.random.default_rng(seed))
    for strength in (0.1, 1.0, 10.0):
        values = scaled(stribeck, shape, strength, SCALES)
        assert values["T_s"] / values["T_c"] == pytest.approx(shape["T_s"] / shape["T_c"])
        assert values["T_s"] <= 0.2 * SCALES["drive"] * (1.0 + 1e-12)
