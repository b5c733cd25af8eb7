"""When a second effect is asked for, and what it must do where the noise floor is only known from below."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from rigsight.diagnose import examination

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
    monkeypatch.setattr(examination, "grown", lambda *_: found)
    monkeypatch.setattr(examination, "with_joint_starts", lambda _context, _without, pairs, *_: pairs)
    reidentified = scored((), error_over_noise=40.0)
    models = SimpleNamespace(
        context=None, singles=[scored(SINGLE, error_over_noise=single)], reidentified=reidentified
    )
    checks = SimpleNamespace(is_adequate=lambda _: adequate)
    kept = examination._grown(models, [], None, checks, adequate is not None, None)
    assert kept == (found if competes else [])
