from __future__ import annotations

import numpy as np
import pytest

from rigsight.records.signals import clipping, is_constant

T = 0.005 * np.arange(4000)
SWEEP = np.sin(2 * np.pi * (0.5 * T + 0.05 * T**2))
RNG = np.random.default_rng(4)


@pytest.mark.parametrize("level", [0.5, 0.8, 0.95])
def test_cut_peaks_are_found(level: float) -> None:
    found = dict(clipping(np.clip(SWEEP, -level, 2.0)))
    assert set(found) == {-level}
    assert found[-level] > 50


def test_cut_peaks_are_found_between_rests() -> None:
    rest = np.zeros(SWEEP.size // 4)
    assert len(clipping(np.concatenate([rest, np.clip(SWEEP, -0.8, 0.8), rest]))) == 2


def test_cut_peaks_are_found_after_a_converter() -> None:
    quantum = 2.0 / 4096
    assert len(clipping(np.clip(np.round(SWEEP / quantum) * quantum, -0.8, 0.8))) == 2


def test_cut_peaks_are_found_in_a_noisy_multisine() -> None:
    multisine = sum(
        np.cos(2 * np.pi * f * T + p) for f, p in zip(range(1, 9), RNG.uniform(0, 6, 8), strict=True)
    )
    limit = 0.7 * np.abs(multisine).max()
    assert clipping(multisine + 0.001 * RNG.normal(size=T.size)) == ()
    assert clipping(np.minimum(multisine, limit))[0][0] == limit


@pytest.mark.parametrize(
    "samples",
    [
        SWEEP,
        np.where(T < 5, 0.0, 0.6),
        np.where(np.sin(T) > 0, 1.0, -1.0),
        np.repeat(RNG.choice([-1.0, 0.0, 1.0], 400), 10),
        np.concatenate([np.zeros(2000), SWEEP[:2000] + 1.0]),
        np.where(T < 5, 0.0, 1 - np.exp(-np.maximum(T - 5, 0)) * np.cos(20 * (T - 5))),
        np.round(SWEEP / 0.05) * 0.05,
        RNG.normal(size=4000),
        np.ones(100),
    ],
    ids=[
        "sweep",
        "step",
        "square",
        "held levels",
        "rest before",
        "step response",
        "coarse",
        "noise",
        "constant",
    ],
)
def test_signals_that_stand_still_for_other_reasons_are_not_called_clipped(samples: np.ndarray) -> None:
    assert clipping(samples) == ()


def test_constant_allows_rounding_only() -> None:
    assert is_constant(np.zeros(10))
    assert is_constant(0.1 + 1e-16 * np.arange(10))
    assert not is_constant(np.array([0.0, 1e-9]))
    assert not is_constant(np.array([1.0, 1.0 + 1e-9]))
