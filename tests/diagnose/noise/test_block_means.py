"""Every value of a record counts the same, however long its record is and whatever its block."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.noise.block_means import blocks_of, squared_errors

UNEVEN = (4000, 130, 70, 1900)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


def test_the_mean_is_that_of_all_values(rng) -> None:
    series = [rng.standard_normal((n, 2)) + n for n in UNEVEN]
    np.testing.assert_allclose(blocks_of(series).mean, np.mean(np.concatenate(series), axis=0))


def test_resamplings_scatter_about_it_by_its_standard_error(rng) -> None:
    blocks = blocks_of([rng.standard_normal((n, 1)) + (n == 130) for n in UNEVEN])
    means = blocks.resampled(blocks.draws(rng))
    assert np.mean(means) == pytest.approx(blocks.mean[0], abs=0.1 * blocks.standard_error[0])
    assert np.std(means) == pytest.approx(blocks.standard_error[0], rel=0.1)


def test_a_single_block_tells_no_standard_error() -> None:
    assert blocks_of([np.ones((1, 1))]).standard_error[0] == np.inf


def test_squared_errors_are_over_all_values_that_were_measured(rng) -> None:
    residuals = [rng.standard_normal((n, 2)) * [n, 0.1] for n in UNEVEN]
    residuals[1][:, 0] = np.nan
    residuals[3][40:60] = np.nan
    over_noise = np.concatenate(residuals) / [2.0, 0.1]
    blocks = squared_errors([residuals, [2.0 * r for r in residuals]], np.array([2.0, 0.1]))
    np.testing.assert_allclose(blocks.mean, np.nanmean(over_noise**2) * np.array([1.0, 4.0]))


def test_the_standard_error_of_records_of_unequal_length_is_their_scatter(rng) -> None:
    drawn = [blocks_of([rng.standard_normal((n, 1)) ** 2 for n in UNEVEN]) for _ in range(300)]
    scatter = np.std([blocks.mean[0] for blocks in drawn])
    assert np.mean([blocks.standard_error[0] for blocks in drawn]) == pytest.approx(scatter, rel=0.15)
