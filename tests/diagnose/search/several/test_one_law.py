"""Two effects that are one law together are named only where no other form of that law is needed to explain them."""

from __future__ import annotations

import pytest

from rigsight.diagnose.search.evidence_for_more import is_linear, is_one_law, split_distinguishable
from rigsight.effects import CATALOGUE

SPRINGS = ("bouc_wen_hysteresis", "cubic_stiffness")
UNLIKE = ("bouc_wen_hysteresis", "quadratic_damping")


@pytest.mark.parametrize(
    ("effects", "one"),
    [
        (SPRINGS, True),
        (("quadratic_damping", "stribeck_friction"), True),
        (("flexible_mode", "actuator_lag"), True),
        (("power_law_stiffness", "torque_ripple"), True),
        (("backlash", "torque_ripple"), False),
        (UNLIKE, False),
        (("flexible_mode", "cubic_stiffness"), False),
        (("cubic_stiffness",), False),
        (("flexible_mode",), False),
    ],
)
def test_one_law_is_told_from_two(scored, effects: tuple[str, ...], one: bool) -> None:
    assert is_one_law(scored(effects)) == one


@pytest.mark.parametrize(
    ("effects", "left", "leaves_noise", "single", "stays"),
    [
        (SPRINGS, 1.04, True, 5.0, True),
        (SPRINGS, 1.04, False, 5.0, False),
        (SPRINGS, 1.0, False, 5.0, True),
        (SPRINGS, 1.0, True, 1.1, False),
        (UNLIKE, 1.04, False, 5.0, True),
        (UNLIKE, 1.04, True, 1.1, True),
    ],
)
def test_a_pair_of_one_law_must_leave_noise_and_be_needed(
    scored, effects: tuple[str, ...], left: float, leaves_noise: bool, single: float, stays: bool
) -> None:
    pair = scored(effects, error_over_noise=left)
    kept, imitations = split_distinguishable(
        [pair], [scored((effects[0],), error_over_noise=single)], 1.15, lambda _: leaves_noise
    )
    assert (kept, imitations) == (([pair], []) if stays else ([], [pair]))


def test_the_best_pair_of_one_law_is_asked_for_all(scored) -> None:
    near, far = scored(SPRINGS, error_over_noise=1.04), scored(SPRINGS, error_over_noise=1.4)
    asked = []

    def leaves_noise(model) -> bool:
        asked.append(model)
        return True

    kept, _ = split_distinguishable(
        [far, near], [scored(SPRINGS[:1], error_over_noise=5.0)], 1.15, leaves_noise
    )
    assert kept == [far, near]
    assert asked == [near]


@pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)
def test_linear_effects_are_known(effect) -> None:
    reidentified = {
        "flexible_mode", "maxwell_branch", "inertia", "actuator_lag", "input_delay", "sensor_lag", "sensor_delay", "time_shift",
        "flexible_gear", "integral_action", "speed_loop_integral", "derivative_action", "pid_action", "velocity_feedforward",
        "command_filter", "command_delay",
    }  # fmt: skip
    assert is_linear(effect) == (effect.name in reidentified)
