"""Errors are measured against the spread of the signal."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rigsight.metrics import nrmse, rms


def test_rms_of_a_sine_is_its_amplitude_over_root_two() -> None:
    phase = 2.0 * np.pi * np.arange(100) / 100
    assert rms(3.0 * np.sin(phase)) == pytest.approx(3.0 / math.sqrt(2.0), rel=1e-12)


def test_rms_counts_a_constant_error() -> None:
    assert rms(np.full(7, -2.0)) == 2.0


def test_nrmse_is_one_for_a_simulation_that_stays_at_the_mean() -> None:
    measured = 5.0 + np.sin(np.arange(200) * 0.1)
    assert nrmse(measured - np.mean(measured), measured) == pytest.approx(1.0, rel=1e-12)


def test_nrmse_does_not_depend_on_unit_or_offset_of_the_signal() -> None:
    rng = np.random.default_rng(1)
    measured, residuals = rng.standard_normal(300), 0.1 * rng.standard_normal(300)
    assert nrmse(1e3 * residuals, 1e3 * measured + 40.0) == pytest.approx(
        nrmse(residuals, measured), rel=1e-12
    )


def test_a_constant_signal_has_no_scale() -> None:
    assert nrmse(np.full(5, 0.1), np.full(5, 2.0)) == math.inf
    assert nrmse(np.zeros(5), np.full(5, 2.0)) == 0.0
