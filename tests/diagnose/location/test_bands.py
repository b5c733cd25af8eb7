from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.location.bands import band_edges, band_powers, dominant_frequency, spectrum
from rigsight.excitation import linear_sweep

DT = 0.01
T = DT * np.arange(6000)
EDGES = np.array([0.0, 2.0, 10.0, 50.0, np.pi / DT])


def test_the_power_of_the_bands_adds_up_to_the_mean_square() -> None:
    samples = np.random.default_rng(0).standard_normal(T.size) + np.sin(5.0 * T) + 0.3
    assert np.sum(band_powers(samples, DT, EDGES)) == pytest.approx(np.mean(samples**2), rel=1e-9)


def test_a_sine_lies_in_its_band() -> None:
    powers = band_powers(2.0 * np.sin(25.0 * T), DT, EDGES)
    assert powers[2] == pytest.approx(2.0, rel=0.01)
    assert np.sum(powers) - powers[2] < 0.01


def test_white_noise_fills_each_band_by_its_width() -> None:
    rng = np.random.default_rng(1)
    powers = np.mean([band_powers(rng.standard_normal(T.size), DT, EDGES) for _ in range(40)], axis=0)
    np.testing.assert_allclose(powers, np.diff(EDGES) / EDGES[-1], rtol=0.08)


def test_the_ends_of_a_sweep_weigh_as_much_as_its_middle() -> None:
    """A residual in the first tenth of the record keeps its power, and its frequency."""
    start = np.sin(5.0 * T) * (T <= 6.0)
    powers = band_powers(start, DT, EDGES)
    assert powers[1] > 0.9 * np.mean(start**2)


def test_the_bands_span_what_the_input_excites_and_the_rig_answers() -> None:
    source = linear_sweep(T, 1.0, 3.0, 50.0)
    response = source + 1e-3 * np.random.default_rng(2).standard_normal(T.size)
    edges = band_edges([(source, response, DT)], 1e-3)
    assert edges[0] == 0.0
    assert edges[-1] == pytest.approx(np.pi / DT)
    assert 2.0 < edges[1] < 8.0
    assert 45.0 < edges[-2] < 60.0
    assert np.all(np.diff(edges) > 0.0)


def test_the_bands_of_a_step_reach_to_where_the_rig_rings() -> None:
    step = np.where(T > 10.0, 1.0, 0.0)
    response = step * (1.0 - np.exp(-1.2 * (T - 10.0)) * np.cos(12.0 * (T - 10.0)))
    edges = band_edges([(step, response, DT)], 1e-3)
    assert 12.0 < edges[-2] < 40.0


def test_an_input_at_rest_has_bands_all_the_same() -> None:
    edges = band_edges([(np.zeros(200), np.zeros(200), DT)], 1.0)
    assert np.all(np.diff(edges) > 0.0)
    assert np.all(spectrum(np.zeros(200), DT)[1] == 0.0)


def test_the_frequency_of_a_stretch_is_that_of_its_wave() -> None:
    assert dominant_frequency(3.0 + np.sin(20.0 * T[:500]), DT, 2.0) == pytest.approx(20.0, rel=0.01)
    assert np.isnan(dominant_frequency(np.ones(100), DT, 2.0))
