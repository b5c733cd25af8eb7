"""Two effects that are one law together are named only where no other form of that law is needed to explain them."""

from __future__ import annotations

import pytest

from rigsight.diagnose.search.one_law import is_linear, is_one_law, split_distinguishable
from rigsight.effects import CATALOGUE

SPRINGS = ("bouc_wen_hysteresis", "cubic_stiffness")
UNLIKE = ("bouc_wen_hysteresis", "quadratic_damping")


@pytest.mark.parametrize(
    ("effects", "one"),
    [
        (SPRINGS, True),
        (("quadratic_damping", "stribeck_friction"), True),
        (("flexible_mode", "actuator_lag"), True),
        (UNLIKE, False),
        (("flexible_mode", "cubic_stiffness"), False),
        (("cubic_stiffness",), False),
        (("flexible_mode",), False),
    ],
)
def test_one_law_is_told_from_two(scored, effects: tuple[str, ...], one: bool) -> None:
    assert is_one_law(scored(effects)) == one


@pytest.mark.parametrize(
    ("effects", "left", "single", "stays"),
    [
        (SPRINGS, 1.0, 5.0, True),
        (SPRINGS, 1.06, 5.0, False),
        (SPRINGS, 1.0, 1.1, False),
        (UNLIKE, 1.06, 5.0, True),
        (UNLIKE, 1.0, 1.1, True),
    ],
)
def test_a_pair_of_one_law_must_be_exact_and_needed(
    scored, effects: tuple[str, ...], left: float, single: float, stays: bool
) -> None:
    pair = scored(effects, error_over_noise=left)
    kept, imitations = split_distinguishable(
        [pair], [scored((effects[0],), error_over_noise=single)], allowed=1.15
    )
    assert (kept, imitations) == (([pair], []) if stays else ([], [pair]))


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_linear_effects_are_known(effect) -> None:
    reidentified = {
        "flexible_mode", "maxwell_branch", "inertia", "actuator_lag", "input_delay", "sensor_lag", "sensor_delay", "time_shift",
    }  # fmt: skip
    assert is_linear(effect) == (effect.name in reidentified)
