from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import (
    crest_factor,
    linear_sweep,
    log_sweep,
    multisine,
    multisine_lines,
    step,
)

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


N = 2000
DT = 5e-3


def test_a_sine_has_the_crest_factor_of_a_sine() -> None:
    assert crest_factor(np.sin(2.0 * np.pi * np.arange(1000) / 100)) == pytest.approx(np.sqrt(2.0))
    with pytest.raises(InputError, match="no crest factor"):
        crest_factor(np.zeros(10))


@pytest.mark.parametrize("kind", ["full", "odd", "odd_random"])
def test_a_multisine_excites_its_lines_and_nothing_else(kind: str) -> None:
    lines = multisine_lines(N, DT, 1.0, 60.0, kind, np.random.default_rng(1))
    wave = multisine(N, DT, lines, 0.7, np.random.default_rng(2))
    amplitudes = 2.0 / N * np.abs(np.fft.rfft(wave.samples))
    np.testing.assert_allclose(amplitudes[lines], wave.amplitudes)
    assert np.max(np.delete(amplitudes, lines)) < 1e-12
    assert np.sqrt(np.mean(wave.periods(3) ** 2)) == pytest.approx(0.7)
    assert wave.omega[0] >= 1.0
    assert wave.omega[-1] <= 60.0


def test_one_odd_line_of_every_group_detects() -> None:
    odd = multisine_lines(N, DT, 1.0, 60.0, "odd")
    kept = multisine_lines(N, DT, 1.0, 60.0, "odd_random", np.random.default_rng(3), group=4)
    omitted = np.setdiff1d(odd, kept)
    assert np.all(odd % 2 == 1)
    assert omitted.size == odd.size // 4
    np.testing.assert_array_equal(np.searchsorted(odd, omitted) // 4, np.arange(omitted.size))


def test_a_given_spectrum_stays_while_the_crest_factor_falls() -> None:
    lines = multisine_lines(N, DT, 1.0, 60.0)
    spectrum = 1.0 / np.sqrt(lines)
    plain = multisine(N, DT, lines, 1.0, np.random.default_rng(4), spectrum)
    flat = multisine(N, DT, lines, 1.0, np.random.default_rng(4), spectrum, crest_iterations=300)
    assert flat.crest_factor < 1.75 < 2.5 < plain.crest_factor
    found = np.abs(np.fft.rfft(flat.samples))[lines]
    np.testing.assert_allclose(found / found[0], spectrum / spectrum[0])
    turned = multisine(N, DT, lines[::-1], 1.0, np.random.default_rng(4), spectrum[::-1])
    np.testing.assert_allclose(turned.samples, plain.samples)


def test_a_multisine_that_cannot_be_is_told() -> None:
    rng = np.random.default_rng(5)
    with pytest.raises(InputError, match="Nyquist frequency 628"):
        multisine_lines(N, DT, 1.0, 700.0)
    with pytest.raises(InputError, match="use a longer period"):
        multisine_lines(N, DT, 1.0, 1.1)
    with pytest.raises(InputError, match="needs 4"):
        multisine_lines(N, DT, 1.0, 3.0, "odd_random", rng)
    with pytest.raises(InputError, match="need a random generator"):
        multisine_lines(N, DT, 1.0, 60.0, "odd_random")
    with pytest.raises(InputError, match="The kind of lines is 'even'"):
        multisine_lines(N, DT, 1.0, 60.0, "even")
    with pytest.raises(InputError, match="different whole numbers from 1"):
        multisine(N, DT, np.array([0, 1]), 1.0, rng)
    with pytest.raises(InputError, match="one number or of shape"):
        multisine(N, DT, np.array([1, 3]), 1.0, rng, np.ones(3))
    with pytest.raises(InputError, match="must be positive"):
        multisine(N, DT, np.array([1, 3]), -1.0, rng)
    with pytest.raises(InputError, match="at least one period"):
        multisine(N, DT, np.array([1, 3]), 1.0, rng).periods(0)
