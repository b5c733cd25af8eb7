"""A signal goes on beyond its ends as it went before them."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.simulate.input_hold import continued, hold_input

DT = 5e-3
T = DT * np.arange(-60, 1060)


def tones(t: np.ndarray) -> np.ndarray:
    return 2.0 + np.sin(9.0 * t) + 0.5 * np.cos(31.0 * t + 1.0)


def test_tones_go_on() -> None:
    np.testing.assert_allclose(continued(tones(T[60:-60]), 60), tones(T), atol=1e-4)


@pytest.mark.parametrize("samples", [[1.0], [1.0, 2.0], [0.0, 1.0, 0.0], [3.0] * 50, [0.0] * 30 + [1.0] * 30])
def test_short_constant_and_broken_signals_stay_in_reach(samples: list[float]) -> None:
    found = continued(np.array(samples), 40)
    reach = max(samples) - min(samples)
    assert found.size == len(samples) + 80
    np.testing.assert_array_equal(found[40:-40], samples)
    assert min(samples) - reach - 1e-12 <= np.min(found)
    assert np.max(found) <= max(samples) + reach + 1e-12


def test_noise_does_not_run_away() -> None:
    noise = np.random.default_rng(0).standard_normal(400)
    assert np.max(np.abs(continued(noise, 100))) < 3.0 * np.max(np.abs(noise))


def test_the_size_of_a_signal_is_no_matter() -> None:
    """A model that runs away moves by 1e200 and more: squares of that are no numbers."""
    signal = tones(T[60:-60])
    np.testing.assert_allclose(continued(1e250 * signal, 60), 1e250 * continued(signal, 60), rtol=1e-6)


def test_slopes_of_a_sampled_analog_signal_are_right_to_its_last_sample() -> None:
    """A reflection of the samples at the end made the last slope wrong by several percent of the largest."""
    inside = T[60:-60]
    slope = 9.0 * np.cos(9.0 * inside) - 15.5 * np.sin(31.0 * inside + 1.0)
    found = hold_input(tones(inside), DT, "band_limited").at_samples(inside.size)[1]
    np.testing.assert_allclose(found[:-1], slope[:-1], atol=1e-3 * np.max(np.abs(slope)))
