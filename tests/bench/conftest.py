"""Trials that are drawn once, and outcomes of trials."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rigsight_bench.scoring import Outcome, ParameterError, WithheldError
from rigsight_bench.trials import Trial, draw_trial


@pytest.fixture(scope="session")
def drawn(kept: Callable[[str, Callable[[], Any]], Any]) -> Callable[[int, int], Trial]:
    """Return a trial of the standard design by seed and number; to draw one takes ten seconds."""
    return lambda seed, number: kept(f"trial-{seed}-{number}", lambda: draw_trial("standard", seed, number))


@pytest.fixture
def outcome_like() -> Callable[..., Outcome]:
    """Return an outcome of a blind trial, right unless it is told otherwise."""

    def like(**changes: Any) -> Outcome:
        content: dict[str, Any] = {
            "design": "standard", "seed": 1, "trial": "000", "fingerprint": "", "version": "1.0",
            "kind": "single", "effects": ("backlash",), "places": ("dynamics",),
            "rig": "axis", "noise": "low", "gap": 12.0, "tier": "clear",
            "verdict": "effect", "named": ("backlash",), "named_places": ("dynamics",), "right": True, "effect_right": True,
            "right_within_set": True, "place_right": True, "looked_at": None,
            "probability": 0.9, "stated": 0.9, "stated_is_true": True, "in_set": True, "set_size": 1, "several_places": False,
            "held_out": 1.02,
            "withheld": (WithheldError("withheld_1", "step", 0.85, 3000, 1.02),),
            "parameters": (ParameterError("g", "backlash", -0.5), ParameterError("k", "rig", 1.5)),
            "seconds": 20.0,
        }  # fmt: skip
        return Outcome(**(content | changes))

    return like


@pytest.fixture
def wrong_outcome(outcome_like: Callable[..., Outcome]) -> Callable[..., Outcome]:
    """Return an outcome of a trial of which the wrong effect was named."""

    def like(**changes: Any) -> Outcome:
        content: dict[str, Any] = {
            "named": ("free_play",), "right": False, "effect_right": False, "right_within_set": False,
            "probability": 0.2, "stated": 0.75, "stated_is_true": False, "in_set": False,
            "parameters": (),
        }  # fmt: skip
        return outcome_like(**(content | changes))

    return like
