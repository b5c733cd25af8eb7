"""When a second effect is asked for, and what it must do where the noise floor is only known from below."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.several import several_effects as search

SINGLE = ("periodic_disturbance",)
PAIR = ("periodic_disturbance", "cubic_stiffness")


@pytest.mark.parametrize(
    ("single", "pair", "adequate", "competes"),
    [
        pytest.param(1.9, 1.02, False, True, id="reaches the very bound"),
        pytest.param(1.9, 1.3, False, False, id="may as well fit noise"),
        pytest.param(1.9, 1.02, True, False, id="nothing but noise is left already"),
        pytest.param(20.0, 1.3, False, True, id="more is left than noise could be"),
        pytest.param(1.9, 1.3, None, True, id="a measured floor"),
    ],
)
def test_above_a_lower_bound_a_pair_must_reach_it(
    scored,
    monkeypatch: pytest.MonkeyPatch,
    single: float,
    pair: float,
    adequate: bool | None,
    competes: bool,
) -> None:
    found = [scored(PAIR, error_over_noise=pair)]
    monkeypatch.setattr(search, "grown", lambda *_: found)
    monkeypatch.setattr(search, "with_joint_starts", lambda _context, _without, pairs, *_: pairs)
    kept = search.several_effects(
        None,
        scored((), error_over_noise=40.0),
        [scored(SINGLE, error_over_noise=single)],
        [],
        None,
        SimpleNamespace(is_adequate=lambda _: adequate),
        adequate is not None,
        None,
    )
    assert kept == (found if competes else [])


@pytest.mark.parametrize(
    ("single", "adequate", "lower_bound", "nothing_left"),
    [
        pytest.param(1.06, False, False, VERDICT.exact, id="near the floor, and no noise"),
        pytest.param(1.06, True, False, VERDICT.at_floor, id="near the floor, noise"),
        pytest.param(1.02, False, False, VERDICT.at_floor, id="at the floor"),
        pytest.param(5.0, False, False, VERDICT.at_floor, id="far above it"),
        pytest.param(1.06, False, True, VERDICT.at_floor, id="a lower bound"),
    ],
)
def test_near_the_floor_a_remainder_that_is_no_noise_asks_for_a_second_effect(
    scored,
    monkeypatch: pytest.MonkeyPatch,
    single: float,
    adequate: bool,
    lower_bound: bool,
    nothing_left: float,
) -> None:
    asked: list[float] = []

    def grown(_context, _singles, _effects, at_floor: float, *_: object) -> list:
        asked.append(at_floor)
        return []

    monkeypatch.setattr(search, "grown", grown)
    search.several_effects(
        None,
        scored((), error_over_noise=40.0),
        [scored(SINGLE, error_over_noise=single)],
        [],
        None,
        SimpleNamespace(is_adequate=lambda _: adequate),
        lower_bound,
        None,
    )
    assert asked == [nothing_left]
