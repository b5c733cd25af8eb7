"""Smoothing of a measured motion: as cross validation by the book, at a thousandth of its time."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.interpolate import make_smoothing_spline

from rigsight.simulate.input_hold import hold_accelerated_motion
from rigsight.simulate.prescribed_motion import _penalty, accelerated_motion, smooth_motion, smoothed_noise

DT = 0.01


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_noise_is_smoothed_as_by_exact_cross_validation(noise):
    rng = np.random.default_rng(5)
    t = DT * np.arange(800)
    clean, slope = np.sin(5.0 * t) + 0.3 * t, 5.0 * np.cos(5.0 * t) + 0.3
    measured = clean + noise * rng.standard_normal(t.size)
    value, rate = smooth_motion(measured, DT)
    exact = make_smoothing_spline(t, measured)
    assert np.std(rate - slope) < 1.2 * np.std(exact.derivative()(t) - slope)
    assert np.std(value - clean) < 1.2 * np.std(exact(t) - clean)
    assert np.std(value - clean) < 0.5 * noise


@pytest.mark.slow
def test_threads_smooth_more_motions_than_are_kept(monkeypatch):
    interval = sys.getswitchinterval()
    monkeypatch.setattr("rigsight.simulate.prescribed_motion._CACHED_SAMPLES", 100)
    monkeypatch.setattr("rigsight.simulate.prescribed_motion._spline", lambda samples: (samples,) * 3)
    motions = np.random.default_rng(0).standard_normal((10_000, 20))
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as threads:
            smoothed = list(threads.map(lambda motion: smooth_motion(motion, DT)[0], motions))
    finally:
        sys.setswitchinterval(interval)
    np.testing.assert_array_equal(smoothed, motions)


def test_a_motion_without_noise_stays_what_it_is():
    t = DT * np.arange(2000)
    x = np.sin(3.0 * t) * np.cos(11.0 * t) + 2.0
    value, rate = smooth_motion(x, DT)
    np.testing.assert_allclose(value, x, atol=1e-5)
    exact = 3.0 * np.cos(3.0 * t) * np.cos(11.0 * t) - 11.0 * np.sin(3.0 * t) * np.sin(11.0 * t)
    np.testing.assert_allclose(rate[5:-5], exact[5:-5], atol=0.02)


def test_a_rough_motion_is_not_flattened():
    """A random motion up to half the sampling frequency has no smooth part to fall back on."""
    rng = np.random.default_rng(6)
    spectrum = np.zeros(1001, complex)
    spectrum[1:600] = np.exp(2j * np.pi * rng.random(599))
    x = np.fft.irfft(spectrum) * 100.0
    value, _ = smooth_motion(x, DT)
    assert np.std(value - x) < 0.1 * np.std(x)


@pytest.mark.parametrize("noise", [1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize("frequency", [1.0, 3.0, 8.0])
def test_the_ends_of_a_motion_are_known_nearly_as_well_as_its_middle(frequency: float, noise: float) -> None:
    """A natural spline is straight there: it missed the last velocities by 4 to 500 times its error inside."""
    rng, dt = np.random.default_rng(3), 5e-3
    t = dt * np.arange(4000)
    ratios = []
    for phase in rng.uniform(0.0, 2.0 * np.pi, 6):
        turns = 2.0 * np.pi * frequency * t + phase
        _, velocity = smooth_motion(np.sin(turns) + noise * rng.standard_normal(t.size), dt)
        error = velocity - 2.0 * np.pi * frequency * np.cos(turns)
        ends = np.concatenate([error[:3], error[-3:]])
        ratios.append(float(np.sqrt(np.mean(ends**2)) / np.std(error[100:-100])))
    assert np.median(ratios) < 3.0


def test_noise_moves_a_spline_as_another_spline_of_that_smoothness_says() -> None:
    rng, dt, n = np.random.default_rng(3), 0.01, 2000
    motion = np.sin(5.0 * dt * np.arange(n)) + 1e-3 * rng.standard_normal(n)
    noise = 1e-5 * rng.standard_normal(n)
    spline = make_smoothing_spline(np.arange(float(n)), noise, lam=_penalty(motion / np.std(motion)))
    index, inside = np.arange(float(n)), slice(100, -100)
    expected = spline(index), spline.derivative()(index) / dt
    for reported, change in zip(smoothed_noise(motion, noise, dt), expected, strict=True):
        assert np.std((reported - change)[inside]) < 0.05 * np.std(change[inside])


@pytest.mark.parametrize("samples_per_cycle", [12, 17, 30])
def test_velocity_and_acceleration_of_a_fast_motion_are_exact(samples_per_cycle: int) -> None:
    omega = 2.0 * np.pi / (samples_per_cycle * DT)
    t = DT * np.arange(600)
    inside = slice(60, -60)
    value, rate, acceleration = accelerated_motion(np.sin(omega * t), DT)
    assert np.std(rate[inside] / omega - np.cos(omega * t)[inside]) < 1e-5
    assert np.std(acceleration[inside] / omega**2 + np.sin(omega * t)[inside]) < 1e-3
    held = hold_accelerated_motion(value, rate, acceleration, DT)
    np.testing.assert_array_equal(held.at_samples(t.size)[2, :-1], acceleration[:-1])


def test_a_motion_in_two_pieces_is_continuous_and_meets_its_samples() -> None:
    rng = np.random.default_rng(2)
    value, rate, acceleration = rng.standard_normal((3, 20))
    held = hold_accelerated_motion(value, rate, acceleration, DT)
    c0, c1, c2, c3 = held.coefficients[1:].T
    h = held.interval
    ends = c0 + h * (c1 + h * (c2 + h * c3)), c1 + h * (2.0 * c2 + 3.0 * h * c3), 2.0 * c2 + 6.0 * h * c3
    np.testing.assert_allclose(ends[0][:-1], c0[1:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(ends[1][:-1], c1[1:], rtol=1e-9, atol=1e-9)
    for samples, starts, end in zip((value, rate, acceleration), (c0, c1, 2.0 * c2), ends, strict=True):
        np.testing.assert_allclose(starts[::2], samples[:-1], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(end[1::2], samples[1:], rtol=1e-7, atol=1e-7)
