"""What an input looks like."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.excitation import linear_sweep
from rigsight.workflow.campaign.record_proposal import guess_amplitude, guess_kind

T = 1e-3 * np.arange(8000)
PERIOD = 1e-3 * np.arange(2000)
LINES = sum(np.cos(2 * np.pi * k * PERIOD / 2.0 + k**2) for k in range(1, 12))
INPUTS = {
    "sweep": linear_sweep(T, 1.5, 1.0, 60.0),
    "falling sweep": linear_sweep(T, 1.5, 1.0, 60.0)[::-1],
    "step": np.where(T > 2.0, 1.5, 0.0),
    "steps": np.select([T < 2, T < 4, T < 6], [0.0, 1.5, -1.5], 0.5),
    "multisine": np.tile(LINES, 4),
    "operation": np.cumsum(np.random.default_rng(1).normal(size=T.size)),
    "noise": np.random.default_rng(2).normal(size=T.size),
    "nothing": np.zeros(T.size),
}
KINDS = {"falling sweep": "sweep", "steps": "step", "noise": "operation", "nothing": "operation"}


@pytest.mark.parametrize("name", INPUTS)
def test_kinds(name: str) -> None:
    assert guess_kind(INPUTS[name]) == KINDS.get(name, name)


def test_amplitudes() -> None:
    assert guess_amplitude(INPUTS["sweep"], "sweep") == pytest.approx(1.5, rel=1e-2)
    assert guess_amplitude(INPUTS["step"], "step") == 1.5
    assert guess_amplitude(INPUTS["operation"], "operation") is None
