"""A hidden effect keeps its form whatever its strength."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight_bench.trials.strength import draw_shape, scaled

SCALES = {"x": 0.1, "time": 0.05, "force": 2.0, "input": 1.0, "drive": 2.0}


@pytest.mark.parametrize("seed", range(5))
def test_static_friction_stays_above_sliding_friction_at_the_limit(seed: int) -> None:
    stribeck = effect_named("stribeck_friction")
    shape = draw_shape(stribeck, SCALES, np.random.default_rng(seed))
    for strength in (0.1, 1.0, 10.0):
        values = scaled(stribeck, shape, strength, SCALES)
        assert values["T_s"] / values["T_c"] == pytest.approx(shape["T_s"] / shape["T_c"])
        assert values["T_s"] <= 0.2 * SCALES["drive"] * (1.0 + 1e-12)


@pytest.mark.parametrize(("name", "number"), [("stribeck_friction", "w_s"), ("flexible_mode", "w_a")])
def test_most_inner_numbers_are_not_where_a_search_begins(name: str, number: str) -> None:
    effect = effect_named(name)
    unit = {"w_s": SCALES["x"] / SCALES["time"], "w_a": 1.0 / SCALES["time"]}[number]
    starts = next(p.starts for p in effect.parameters if p.name == number)
    rng = np.random.default_rng(0)
    drawn = np.array([draw_shape(effect, SCALES, rng)[number] / unit for _ in range(400)])
    nearest = np.min(np.abs(np.log(drawn[:, None] / np.array(starts))), axis=1)
    assert np.mean(nearest < 0.1) < 0.4, "within a tenth of a start"
    assert np.min(drawn) < 0.7 * min(starts)
    assert np.max(drawn) > 1.4 * max(starts)


def test_no_power_law_is_a_linear_spring() -> None:
    effect, rng = effect_named("power_law_stiffness"), np.random.default_rng(0)
    drawn = [draw_shape(effect, SCALES, rng)["n"] for _ in range(200)]
    assert min(drawn) >= 1.2
    assert max(drawn) > 3.5
