"""Periods are found where a signal repeats exactly, and nowhere else."""

from __future__ import annotations

import numpy as np

from rigsight.records.periods import repeated_period


def test_a_repeated_noise_has_its_period() -> None:
    period = np.random.default_rng(0).normal(size=500)
    assert repeated_period(np.tile(period, 3)) == 500


def test_a_sweep_and_a_constant_do_not_repeat() -> None:
    t = np.linspace(0.0, 20.0, 4000)
    assert repeated_period(np.sin(t**2)) is None
    assert repeated_period(np.ones(300)) is None
