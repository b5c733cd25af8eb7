from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep, log_sweep, step

T = 1e-3 * np.arange(20_001)


def frequency(signal: np.ndarray, at: float) -> float:
    """Angular frequency [rad/s] of a sine around a time, from its zero crossings."""
    near = np.abs(T - at) < 1.5
    t, s = T[near], signal[near]
    crossed = np.flatnonzero(np.diff(np.sign(s)) != 0)
    crossings = t[crossed] - s[crossed] * (t[1] - t[0]) / (s[crossed + 1] - s[crossed])
    return float(np.pi * (crossings.size - 1) / (crossings[-1] - crossings[0]))


@pytest.mark.parametrize(
    ("sweep", "half_way"), [(linear_sweep, (10.0 + 90.0) / 2), (log_sweep, np.sqrt(10.0 * 90.0))]
)
def test_a_sweep_passes_the_frequencies_that_its_name_says(sweep, half_way: float) -> None:
    signal = sweep(T, 2.0, 10.0, 90.0)
    assert signal[0] == 0.0
    assert np.max(np.abs(signal)) == pytest.approx(2.0, rel=1e-2)
    assert frequency(signal, 10.0) == pytest.approx(half_way, rel=2e-2)
    assert frequency(signal, 18.5) > frequency(signal, 1.5)


@pytest.mark.parametrize("sweep", [linear_sweep, log_sweep])
def test_a_sweep_of_one_frequency_is_a_sine(sweep) -> None:
    np.testing.assert_allclose(sweep(T + 3.0, 1.0, 10.0, 10.0), np.sin(10.0 * T), atol=1e-9)


def test_frequencies_outside_the_range_are_told() -> None:
    with pytest.raises(InputError, match="end frequency must be at least 0 and at most the Nyquist"):
        linear_sweep(T, 1.0, 0.0, 4000.0)
    with pytest.raises(InputError, match="start frequency must be above 0"):
        log_sweep(T, 1.0, 0.0, 10.0)
    with pytest.raises(InputError, match="at least two samples"):
        log_sweep(T[:1], 1.0, 1.0, 10.0)


def test_a_step_rises_at_its_start() -> None:
    signal = step(T, 0.6, 5.0)
    assert set(signal[T < 5.0]) == {0.0}
    assert set(signal[T >= 5.0]) == {0.6}
