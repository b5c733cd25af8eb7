"""Noise like that of a floor has its size and its spectrum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter, welch

from rigsight.compare import Floor


def test_noise_without_stretches_is_white() -> None:
    noise = Floor("x", "m", 2e-3, "known").noise(20000, 1e-3, np.random.default_rng(1))
    assert np.std(noise) == pytest.approx(2e-3, rel=0.03)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 0.03 * 4e-6


def test_noise_has_the_spectrum_of_the_stretches() -> None:
    dt, rng = 1e-3, np.random.default_rng(2)
    stretch = lfilter([0.1], [1.0, -0.9], rng.normal(size=20000))
    noise = Floor("x", "m", 2e-3, "known", stretches=((stretch, dt),)).noise(30000, dt, rng)
    assert np.std(noise) == pytest.approx(2e-3, rel=1e-9)
    (f, own), (_, wanted) = (welch(x / np.std(x), 1.0 / dt, nperseg=256) for x in (noise, stretch))
    inside = (f > 10.0) & (f < 400.0)
    assert np.abs(np.log10(own[inside] / wanted[inside])).max() < 0.3
