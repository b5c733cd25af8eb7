from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep, log_sweep
from rigsight.records import Record

from ..frequency.conftest import SecondOrder

sys.path.append(str(Path(__file__).parents[2] / "experiments/distortion"))
from harmonics import track_harmonics

DT = 5e-3
T = DT * np.arange(20_000)


def swept(cubic: float, square: float, sweep=linear_sweep, noise: float = 0.0) -> Record:
    u = sweep(T, 2.0, 3.0, 60.0)
    y = u + cubic * u**3 + square * u**2 + noise * np.random.default_rng(17).normal(size=u.size)
    return Record("sweep", DT, {"u": u, "y": y}, {"u": "A", "y": "m"}, kind="sweep", t0=3.0)


@pytest.mark.parametrize("sweep", [linear_sweep, log_sweep])
@pytest.mark.parametrize(("cubic", "square"), [(0.02, 0.0), (0.0, 0.05), (0.02, 0.05)])
def test_a_cubic_makes_odd_and_a_square_even_harmonics(sweep, cubic: float, square: float) -> None:
    # With u = 2 sin: u^3 = 6 sin - 2 sin 3, u^2 = 2 - 2 cos 2.
    track = track_harmonics(swept(cubic, square, sweep), "u", "y")
    fundamental = 2.0 + 6.0 * cubic
    np.testing.assert_allclose(track.harmonics[:, 0], fundamental, atol=2e-3)
    np.testing.assert_allclose(track.harmonics[:, 1], -2j * square, atol=2e-3)
    np.testing.assert_allclose(track.harmonics[:, 2], -2.0 * cubic, atol=2e-3)
    np.testing.assert_allclose(track.odd_content, 2.0 * cubic / fundamental, atol=2e-3)
    np.testing.assert_allclose(track.even_content, 2.0 * square / fundamental, atol=2e-3)


def test_the_frequency_is_that_of_the_sweep_at_that_time() -> None:
    track = track_harmonics(swept(0.02, 0.0), "u", "y")
    np.testing.assert_allclose(track.omega, 3.0 + 57.0 * (track.t - 3.0) / T[-1], rtol=2e-3)
    assert np.all(np.diff(track.omega) > 0.0)


def test_a_linear_system_has_its_response_and_no_harmonics() -> None:
    truth = SecondOrder(D=0.5)
    track = track_harmonics(truth.record(noise=1e-3, rng=np.random.default_rng(18)), "u", "psi")
    expected = truth.response(track.omega)
    np.testing.assert_allclose(track.fundamental.values, expected, atol=0.05)
    assert np.median(np.abs(track.fundamental.values / expected - 1.0)) < 0.01
    assert np.max(track.odd_content[track.omega < 20.0]) < 5e-3
    assert np.max(track.even_content[track.omega < 20.0]) < 5e-3


def test_what_is_no_sweep_is_told() -> None:
    record = swept(0.0, 0.0)
    noise = np.random.default_rng(19).normal(size=T.size)
    with pytest.raises(InputError, match="it is not a sweep"):
        track_harmonics(record.with_signals(u=noise), "u", "y")
    with pytest.raises(InputError, match="passes zero 0 times"):
        track_harmonics(record.with_signals(u=np.ones(T.size)), "u", "y")
    with pytest.raises(InputError, match="fewer than the 6 of one piece"):
        track_harmonics(record.slice(0, 1200), "u", "y")
    with pytest.raises(InputError, match="above the Nyquist frequency everywhere"):
        track_harmonics(record, "u", "y", n_harmonics=200)
    with pytest.raises(InputError, match="must be at least 2"):
        track_harmonics(record, "u", "y", n_harmonics=1)
