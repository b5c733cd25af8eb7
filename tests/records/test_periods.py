"""Periods are found where a signal repeats exactly, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.records.signals import repeated_period, same_signal


def test_a_repeated_noise_has_its_period() -> None:
    period = np.random.default_rng(0).normal(size=500)
    assert repeated_period(np.tile(period, 3)) == 500


@pytest.mark.parametrize("noise", [0.0, 0.0028])
@pytest.mark.parametrize(("period", "count"), [(2000, 6), (2000, 2), (10000, 3)])
def test_a_slow_sine_has_its_period_whatever_its_noise(period: int, count: int, noise: float) -> None:
    x = np.sin(2.0 * np.pi * np.arange(count * period) / period)
    assert repeated_period(x + noise * np.random.default_rng(1).normal(size=x.size)) == period


def test_a_slow_signal_of_one_period_does_not_repeat() -> None:
    """From sample to sample it moves less than its noise, which is no period."""
    x = np.sin(2.0 * np.pi * np.arange(30000) / 30000)
    assert repeated_period(x + 0.0028 * np.random.default_rng(1).normal(size=x.size)) is None


def test_a_sweep_and_a_constant_do_not_repeat() -> None:
    t = np.linspace(0.0, 20.0, 4000)
    assert repeated_period(np.sin(t**2)) is None
    assert repeated_period(np.ones(300)) is None


def test_a_stretch_of_a_signal_is_the_same_signal() -> None:
    rng = np.random.default_rng(0)
    period = 3.0 + rng.normal(size=500)
    twice = np.tile(period, 2)
    assert same_signal(period, period)
    assert same_signal(twice, np.roll(period, 123))
    assert same_signal(np.roll(period, 123), twice)
    # Two measurements of one signal differ by their noise.
    assert same_signal(twice, period + rng.normal(scale=5e-3, size=500))


def test_another_waveform_amplitude_or_mean_is_another_signal() -> None:
    rng = np.random.default_rng(0)
    period = rng.normal(size=500)
    assert not same_signal(period, rng.normal(size=500))
    assert not same_signal(period, rng.normal(size=300))
    assert not same_signal(period, 1.05 * period)
    assert not same_signal(period, period + 0.1)
    assert not same_signal(np.ones(200), np.ones(300))
    # A slow sweep looks like itself at no other time.
    t = 0.01 * np.arange(5000)
    assert not same_signal(np.sin(0.1 * t**2), np.sin(0.13 * t**2))
