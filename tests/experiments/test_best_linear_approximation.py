from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import multisine, multisine_lines
from rigsight.records import Record

sys.path.append(str(Path(__file__).parents[2] / "experiments/distortion"))
from best_linear_approximation import (
    fast_best_linear_approximation,
    robust_best_linear_approximation,
)

DT, N = 5e-3, 2000
CUBIC = 0.1


def realisation(
    rng: np.random.Generator, kind: str, *, cubic: float, square: float, noise: float, periods: int = 4
) -> Record:
    """A static nonlinearity: its best linear gain for a Gaussian input of variance 1 is ``1 + 3 cubic``."""
    lines = multisine_lines(N, DT, 1.0, 60.0, kind, np.random.default_rng(0))
    u = multisine(N, DT, lines, 1.0, rng).periods(periods)
    y = u + cubic * u**3 + square * u**2 + noise * rng.normal(size=u.size)
    return Record("multisine", DT, {"u": u, "y": y}, {"u": "A", "y": "m"}, kind="multisine")


def records(seed: int, count: int, **options: float) -> list[Record]:
    rng = np.random.default_rng(seed)
    return [realisation(rng, "odd", **options) for _ in range(count)]


def test_the_levels_of_a_cubic_are_told_from_noise() -> None:
    found = robust_best_linear_approximation(records(8, 12, cubic=CUBIC, square=0.0, noise=0.1), "u", "y", N)
    clean = records(9, 100, cubic=CUBIC, square=0.0, noise=0.0, periods=1)
    lines = np.round(found.response.omega * N * DT / (2.0 * np.pi)).astype(int)
    ratios = np.array([np.fft.rfft(r["y"])[lines] / np.fft.rfft(r["u"])[lines] for r in clean])
    assert np.mean(found.response.values).real == pytest.approx(1.0 + 3.0 * CUBIC, rel=0.02)
    assert np.mean(found.distortion) == pytest.approx(np.mean(np.var(ratios, axis=0, ddof=1)), rel=0.15)
    # Noise of variance s^2 has s^2 4 / N per line and period; 3 periods and 12 realisations are averaged.
    amplitude = np.sqrt(2.0 / lines.size)
    expected = 0.1**2 * 4.0 / N / amplitude**2 / 3.0 / 12.0
    assert np.mean(found.response.noise_variance) == pytest.approx(expected, rel=0.1)
    error = np.abs(found.response.values - np.mean(ratios)) ** 2
    assert np.mean(error) / np.mean(found.response.variance) == pytest.approx(1.0, abs=0.25)


def test_a_linear_system_shows_no_distortion_and_the_noise_is_the_whole() -> None:
    response = robust_best_linear_approximation(
        records(10, 12, cubic=0.0, square=0.0, noise=0.1), "u", "y", N
    ).response
    assert np.mean(response.variance) / np.mean(response.noise_variance) == pytest.approx(1.0, abs=0.15)
    error = np.abs(response.values - 1.0) ** 2
    assert np.mean(error) / np.mean(response.noise_variance) == pytest.approx(1.0, abs=0.25)


@pytest.mark.parametrize(("cubic", "square"), [(0.0, 0.0), (CUBIC, 0.0), (0.0, 0.1), (CUBIC, 0.1)])
def test_detection_lines_tell_odd_from_even(cubic: float, square: float) -> None:
    record = realisation(
        np.random.default_rng(11), "odd_random", cubic=cubic, square=square, noise=0.01, periods=6
    )
    found = fast_best_linear_approximation(record, "u", "y", N)
    noise = np.mean(found.noise_level)
    assert noise == pytest.approx(0.01**2 * 4.0 / N / 5.0, rel=0.3)
    assert (np.mean(found.odd_level) > 10.0 * noise) == (cubic > 0.0)
    assert (np.mean(found.even_level) > 10.0 * noise) == (square > 0.0)
    error = np.abs(found.response.values - (1.0 + 3.0 * cubic)) ** 2
    assert 0.4 < np.mean(error) / np.mean(found.response.variance) < 2.5


def test_a_distorting_source_is_not_held_against_the_system() -> None:
    record = realisation(np.random.default_rng(12), "odd_random", cubic=0.0, square=0.0, noise=0.0)
    # Small enough that the detection lines stay 60 dB below the excited ones.
    added = 1e-3 * record["u"] ** 3
    driven = record.with_signals(u=record["u"] + added, y=2.0 * (record["u"] + added))
    found = fast_best_linear_approximation(driven, "u", "y", N)
    seen = np.abs(2.0 / N * np.fft.rfft(driven["y"][:N])) ** 2
    lines = np.round(found.odd_omega * N * DT / (2.0 * np.pi)).astype(int)
    assert np.mean(np.abs(found.odd_level)) < 1e-3 * np.mean(seen[lines])


def test_a_band_and_a_hold_are_respected() -> None:
    given = records(14, 3, cubic=0.0, square=0.0, noise=0.01)
    found = robust_best_linear_approximation(given, "u", "y", N, band=(10.0, 20.0), hold="zoh").response
    assert 10.0 <= found.omega[0] < found.omega[-1] <= 20.0
    # A wire seen through a hold seems to lead by half a sample.
    np.testing.assert_allclose(found.phase, 0.5 * DT * found.omega, atol=0.02)


def test_what_cannot_be_estimated_is_told() -> None:
    given = records(15, 2, cubic=0.0, square=0.0, noise=0.01)
    with pytest.raises(InputError, match="at least two realisations"):
        robust_best_linear_approximation(given[:1], "u", "y", N)
    with pytest.raises(InputError, match="record longer, or choose a shorter period"):
        robust_best_linear_approximation(given, "u", "y", 3000)
    with pytest.raises(InputError, match="excites no line from 100 to 200 rad/s"):
        robust_best_linear_approximation(given, "u", "y", N, band=(100.0, 200.0))
    with pytest.raises(InputError, match="leaves out no odd line"):
        fast_best_linear_approximation(given[0], "u", "y", N)
    full = realisation(np.random.default_rng(16), "full", cubic=0.0, square=0.0, noise=0.01)
    with pytest.raises(InputError, match="excites even lines"):
        fast_best_linear_approximation(full, "u", "y", N)
    with pytest.raises(InputError, match="is constant"):
        fast_best_linear_approximation(full.with_signals(u=np.zeros(4 * N)), "u", "y", N)
    with pytest.raises(InputError, match="at least 4 samples"):
        fast_best_linear_approximation(full, "u", "y", 2)
