"""Standard errors of least squares are right for white and for colored residuals."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.identify.fit.covariance import colored_covariance, propagated_covariance

N = 4000


def regressors(n: int = N) -> NDArray[np.float64]:
    """A slow sine, a fast sine and a constant, shape (n, 3)."""
    t = np.arange(n)
    return np.column_stack([np.sin(0.01 * t), np.cos(1.3 * t), np.ones(n)])


def ar1(n: int, pole: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """First-order noise of unit driving variance after its transient."""
    return np.asarray(lfilter([1.0], [1.0, -pole], rng.standard_normal(n + 500)))[500:]


def test_white_residuals_give_the_textbook_covariance() -> None:
    sigma, derivative = 0.3, regressors()
    residual = sigma * np.random.default_rng(1).standard_normal(N)
    covariance = colored_covariance([(residual, derivative)], 3)
    exact = sigma**2 * np.linalg.inv(derivative.T @ derivative)
    # The spectrum is averaged over 15 lines: a variance at one frequency is known to 1/sqrt(15) = 26 %.
    ratio = np.diag(covariance) / np.diag(exact)
    assert np.all(np.abs(ratio - 1.0) < 3.0 / np.sqrt(15.0))


def test_white_residuals_are_right_on_average() -> None:
    derivative = regressors(1000)
    exact = np.diag(np.linalg.inv(derivative.T @ derivative))
    rng = np.random.default_rng(2)
    ratios = np.array(
        [
            np.diag(colored_covariance([(rng.standard_normal(1000), derivative)], 3)) / exact
            for _ in range(100)
        ]
    )
    # 15 lines averaged in each of 100 draws: 1/sqrt(1500) = 3 %; at zero frequency half of them are mirror images.
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=4.0 / np.sqrt(750.0))


def test_colored_residuals_agree_with_a_monte_carlo_of_least_squares() -> None:
    derivative = regressors()
    rng = np.random.default_rng(3)
    inverse = np.linalg.pinv(derivative)
    estimates, predicted = [], []
    for i in range(300):
        noise = ar1(N, 0.9, rng)
        estimate = inverse @ noise
        estimates.append(estimate)
        if i < 60:
            predicted.append(np.diag(colored_covariance([(noise - derivative @ estimate, derivative)], 3)))
    scatter = np.std(np.array(estimates), axis=0)
    error = np.sqrt(np.mean(predicted, axis=0))
    # The scatter of 300 draws is known to 1/sqrt(600) = 4 %; the smoothed spectrum is biased where it bends, at zero frequency.
    np.testing.assert_allclose(error[:2], scatter[:2], rtol=0.15)
    # What white residuals would give is wrong by the spectrum's ratio: 10 for the slow sine, so the test can tell.
    white = np.sqrt(np.diag(np.linalg.inv(derivative.T @ derivative)) / (1.0 - 0.9**2))
    assert scatter[0] > 3.0 * white[0]
    assert scatter[1] < 0.5 * white[1]


def test_a_resonance_in_the_residuals_is_seen_where_it_is() -> None:
    """A disturbance through a lightly damped plant: the error of what is read at its resonance, against Monte Carlo."""
    n, pole = 20_000, 0.999 * np.exp(0.05j)
    denominator = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    t = np.arange(n)
    derivative = np.cos(0.05 * t)[:, None] * np.exp(-(((t - n / 2) / 1000.0) ** 2))[:, None]
    inverse = np.linalg.pinv(derivative)
    rng = np.random.default_rng(8)
    estimates, predicted = [], []
    for i in range(300):
        noise = np.asarray(lfilter([1.0], denominator, rng.standard_normal(n + 5000)))[5000:]
        estimate = inverse @ noise
        estimates.append(estimate[0])
        if i < 80:
            predicted.append(colored_covariance([(noise - derivative @ estimate, derivative)], 1)[0, 0])
    # The resonance is 6 lines wide and the average 15, so it is seen lower than it is, but not several times.
    ratio = np.sqrt(np.mean(predicted)) / np.std(estimates)
    assert 0.75 < ratio < 1.15


def test_outputs_that_one_disturbance_moves_are_not_independent() -> None:
    """Each output has a spectrum of its own, and what both share does not average out."""
    rng = np.random.default_rng(9)
    one, other = np.sin(0.3 * np.arange(N)), np.sin(0.3 * np.arange(N))
    derivative = np.concatenate([one, other])[:, None]
    inverse = np.linalg.pinv(derivative)
    estimates, predicted, alone = [], [], []
    for i in range(300):
        common = ar1(N, 0.5, rng)
        noise = np.concatenate([common, common + 0.1 * rng.standard_normal(N)])
        estimate = inverse @ noise
        estimates.append(estimate[0])
        if i < 60:
            residual = noise - derivative @ estimate
            predicted.append(colored_covariance([(residual, derivative)], 1, [2])[0, 0])
            alone.append(colored_covariance([(residual[:N], derivative[:N])], 1)[0, 0])
    # The scatter of 300 draws is known to 4 %, the mean of 60 predictions to 1/sqrt(900) = 3 % of the variance.
    assert np.sqrt(np.mean(predicted)) == pytest.approx(np.std(estimates), rel=0.15)
    # A second sensor on the same disturbance is hardly any information more.
    assert np.mean(predicted) == pytest.approx(np.mean(alone), rel=0.1)


def test_records_add_their_information() -> None:
    rng = np.random.default_rng(4)
    one = (rng.standard_normal(N), regressors())
    single, double = colored_covariance([one], 3), colored_covariance([one, one], 3)
    np.testing.assert_allclose(double, single / 2.0, rtol=1e-9)


def test_initial_states_of_a_record_widen_the_common_errors_as_joint_regression_does() -> None:
    rng = np.random.default_rng(5)
    decay = np.exp(-np.arange(N) / 300.0)[:, None]
    records = [(rng.standard_normal(N), np.hstack([regressors(), decay])) for _ in range(2)]
    covariance = colored_covariance(records, 3)
    joint = np.zeros((2 * N, 5))
    joint[:N, :3], joint[N:, :3] = regressors(), regressors()
    joint[:N, 3:4], joint[N:, 4:5] = decay, decay
    exact = np.linalg.inv(joint.T @ joint)[:3, :3]
    assert covariance.shape == (3, 3)
    np.testing.assert_allclose(np.diag(covariance), np.diag(exact), rtol=3.0 / np.sqrt(2 * 15.0))


def test_a_coordinate_that_moves_nothing_has_an_infinite_variance() -> None:
    derivative = np.column_stack([regressors(), np.zeros(N)])
    residual = np.random.default_rng(6).standard_normal(N)
    covariance = colored_covariance([(residual, derivative)], 4)
    assert covariance[3, 3] == np.inf
    np.testing.assert_allclose(
        covariance[:3, :3], colored_covariance([(residual, regressors())], 3), rtol=1e-9
    )


def test_two_coordinates_that_do_the_same_are_not_determined() -> None:
    """Only their sum is known; each alone may be anything, so its error must not be a small number."""
    first = regressors()[:, :1]
    derivative = np.hstack([first, first, np.ones((N, 1))])
    residual = np.random.default_rng(7).standard_normal(N)
    covariance = colored_covariance([(residual, derivative)], 3)
    alone = colored_covariance([(residual, np.hstack([first, np.ones((N, 1))]))], 2)
    assert covariance[0, 0] > 1e6 * alone[0, 0]
    assert covariance[1, 1] > 1e6 * alone[0, 0]
    assert covariance[2, 2] == pytest.approx(alone[1, 1], rel=1e-3)


def test_nothing_to_estimate() -> None:
    assert colored_covariance([(np.ones(50), np.zeros((50, 0)))], 0).shape == (0, 0)


def test_an_undetermined_coordinate_spoils_only_the_parameters_that_depend_on_it() -> None:
    covariance = np.array([[4.0, 1.0, 0.0], [1.0, 9.0, 0.0], [0.0, 0.0, np.inf]])
    chain = np.array([[2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.5, 0.5]])
    propagated = propagated_covariance(covariance, chain)
    np.testing.assert_allclose(propagated[:2, :2], [[16.0, 10.0], [10.0, 15.0]])
    assert propagated[2, 2] == np.inf
    assert not np.any(np.isnan(propagated))


@pytest.mark.slow
def test_an_interval_of_a_mean_covers_as_often_as_it_says() -> None:
    rng, ones, inside = np.random.default_rng(7), np.ones((400, 1)), {False: 0, True: 0}
    for _ in range(1000):
        noise = rng.standard_normal(400)
        for widened in inside:
            variance = colored_covariance([(noise - np.mean(noise), ones)], 1, for_intervals=widened)[0, 0]
            inside[widened] += abs(np.mean(noise)) < 1.96 * np.sqrt(variance)
    # 1000 draws: a standard deviation of 0.7 %.
    assert inside[False] < 930
    assert inside[True] == pytest.approx(950, abs=21)


def test_an_interval_that_many_lines_determine_stays() -> None:
    residual, derivative = np.random.default_rng(8).standard_normal(4000), np.zeros((4000, 1))
    derivative[:, 0] = np.random.default_rng(9).standard_normal(4000)
    plain, widened = (colored_covariance([(residual, derivative)], 1, for_intervals=w) for w in (False, True))
    np.testing.assert_allclose(widened, plain, rtol=5e-3)
