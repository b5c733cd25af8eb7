from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.frequency import averaged_response, hold_response
from rigsight.records import Record

RESOLUTION = 2.0 * np.pi / 20.0


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_hold_between_samples_is_taken_out(second_order, hold: str) -> None:
    truth = second_order(D=0.5)
    record = truth.record(duration=1000.0, hold=hold, random=True, rng=np.random.default_rng(0))
    known = averaged_response(record, "u", "psi", RESOLUTION, hold=hold, band=(1.0, 60.0))
    ignored = averaged_response(record, "u", "psi", RESOLUTION, band=(1.0, 60.0))
    above = known.omega > 40.0
    error = np.abs(np.mean((known.values / truth.response(known.omega))[above]) - 1.0)
    assert error < 2e-3
    assert np.abs(np.mean((ignored.values / truth.response(known.omega))[above]) - 1.0) > 3.0 * error


def test_a_dead_time_lags_by_its_phase(second_order) -> None:
    record = second_order(D=0.5).record(duration=500.0, random=True, rng=np.random.default_rng(1), delay=8)
    late = averaged_response(record, "u", "psi", RESOLUTION, hold="foh", band=(1.0, 60.0))
    expected = np.angle(second_order(D=0.5).response(late.omega)) - 0.04 * late.omega
    np.testing.assert_allclose(late.phase, expected, atol=0.06)
    assert late.phase[-1] < -np.pi


def test_variance_is_that_of_repeated_records(second_order) -> None:
    truth, rng = second_order(D=0.5), np.random.default_rng(2)
    clean = truth.record(rng=rng, random=True)
    squares, variances = [], []
    for _ in range(30):
        record = clean.with_signals(psi=clean["psi"] + 0.3 * rng.normal(size=clean.n_samples))
        found = averaged_response(record, "u", "psi", RESOLUTION / 0.25, hold="foh", band=(2.0, 40.0))
        squares.append(np.abs(found.values - truth.response(found.omega)) ** 2)
        variances.append(found.variance)
    assert np.mean(squares) / np.mean(variances) == pytest.approx(1.0, abs=0.2)


def test_each_estimator_withstands_the_noise_it_is_for() -> None:
    rng = np.random.default_rng(3)
    clean = rng.normal(size=200_000)
    noisy = clean + 0.5 * rng.normal(size=clean.size)

    def gain(u: np.ndarray, x: np.ndarray, estimator: str) -> float:
        record = Record("gain", 5e-3, {"u": u, "x": 2.0 * x}, {})
        return float(np.mean(averaged_response(record, "u", "x", RESOLUTION, estimator=estimator).magnitude))

    assert gain(clean, noisy, "H1") == pytest.approx(2.0, rel=0.02)
    assert gain(clean, noisy, "H2") == pytest.approx(2.0 * 1.25, rel=0.02)
    assert gain(noisy, clean, "H2") == pytest.approx(2.0, rel=0.02)
    assert gain(noisy, clean, "H1") == pytest.approx(2.0 / 1.25, rel=0.02)
    other = clean + 0.5 * rng.normal(size=clean.size)
    assert gain(noisy, other, "Hv") == pytest.approx(2.0, rel=0.02)


def test_coherence_is_the_share_of_the_response_that_the_source_explains() -> None:
    rng = np.random.default_rng(4)
    u = rng.normal(size=200_000)
    record = Record("half", 5e-3, {"u": u, "x": u + rng.normal(size=u.size)}, {"u": "A"})
    found = averaged_response(record, "u", "x", RESOLUTION)
    assert np.mean(found.coherence) == pytest.approx(0.5, abs=0.02)
    assert found.unit == "1/A"
    several = averaged_response([record, record.slice(0, 100_000)], "u", "x", RESOLUTION)
    assert several.records == ("half", "half")


def test_a_hold_is_a_delay_of_half_a_sample_or_none() -> None:
    omega = np.linspace(0.1, 100.0, 50)
    np.testing.assert_allclose(np.angle(hold_response(omega, 5e-3, "zoh")), -0.5 * 5e-3 * omega)
    np.testing.assert_allclose(np.angle(hold_response(omega, 5e-3, "foh")), 0.0)
    assert np.all(hold_response(omega, 5e-3, "band_limited") == 1.0)


def test_what_cannot_be_estimated_is_told(second_order) -> None:
    record = second_order().record(duration=20.0)
    with pytest.raises(
        InputError, match=r"lasts 20 s: too short for a resolution of 0\.1 rad/s\. Record at least 62\.83 s"
    ):
        averaged_response(record, "u", "psi", 0.1)
    with pytest.raises(InputError, match="single segment has no coherence"):
        averaged_response(record, "u", "psi", RESOLUTION)
    with pytest.raises(
        InputError, match=r"does not excite .* of the requested band, 5 to 300 rad/s\. It excites"
    ):
        averaged_response(record, "u", "psi", 4.0 * RESOLUTION, band=(5.0, 300.0))
    with pytest.raises(InputError, match="The estimator is 'h1'"):
        averaged_response(record, "u", "psi", 4.0 * RESOLUTION, estimator="h1")
    with pytest.raises(InputError, match="is constant"):
        averaged_response(record.with_signals(u=np.ones(4000)), "u", "psi", 4.0 * RESOLUTION)
    with pytest.raises(InputError, match="does not respond"):
        averaged_response(record.with_signals(psi=np.zeros(4000)), "u", "psi", 4.0 * RESOLUTION)
    with pytest.raises(InputError, match="at least one record"):
        averaged_response([], "u", "psi", RESOLUTION)
