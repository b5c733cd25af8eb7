from __future__ import annotations

import numpy as np
import pytest

from rigsight.errors import InputError
from rigsight.frequency import averaged_response, local_polynomial_response, local_rational_response

METHODS = [local_polynomial_response, local_rational_response]


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize(("method", "bias"), [(METHODS[0], 2e-2), (METHODS[1], 2e-4)])
def test_a_sweep_that_ends_in_motion_gives_the_response(second_order, method, bias: float, hold: str) -> None:
    truth = second_order()
    found = method(truth.record(hold=hold), "u", "psi", hold=hold, band=(1.0, 55.0))
    np.testing.assert_allclose(found.values / truth.response(found.omega), 1.0, atol=bias)


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
@pytest.mark.parametrize(("method", "most"), [(METHODS[0], 1.2), (METHODS[1], 1.35)])
def test_variance_is_that_of_repeated_sweeps(second_order, method, most: float, noise: float) -> None:
    truth, rng = second_order(), np.random.default_rng(5)
    clean = truth.record()
    squares, variances = [], []
    for _ in range(16):
        record = clean.with_signals(psi=clean["psi"] + noise * rng.normal(size=clean.n_samples))
        found = method(record, "u", "psi", hold="foh", band=(3.0, 40.0))
        squares.append(np.abs(found.values - truth.response(found.omega)) ** 2)
        variances.append(found.variance)
    per_line = np.mean(squares, axis=0) / np.mean(variances, axis=0)
    assert 0.85 < np.median(per_line) < most


@pytest.mark.parametrize("noise", [0.0, 1e-1])
def test_a_lightly_damped_peak_is_five_times_better_than_with_a_window(second_order, noise: float) -> None:
    # Equal data: one sweep of 100 s; H1 is given the best of four resolutions, chosen with the truth in hand.
    truth = second_order(D=0.01)
    record = truth.record(noise=noise, rng=np.random.default_rng(6))
    peak = np.max(np.abs(truth.response(np.linspace(11.5, 12.5, 10_001))))

    def height_error(found) -> float:
        return float(abs(np.max(found.band(10.0, 14.0).magnitude) / peak - 1.0))

    local = local_rational_response(record, "u", "psi", hold="foh", band=(2.0, 40.0))
    windowed = min(
        height_error(averaged_response(record, "u", "psi", 2.0 * np.pi / s, hold="foh", band=(2.0, 40.0)))
        for s in (5.0, 10.0, 20.0, 40.0)
    )
    assert 5.0 * height_error(local) < windowed
    around = local.band(11.5, 12.5)
    assert np.max(np.abs(around.values - truth.response(around.omega))) < 5e-3 * peak


def test_a_dead_time_turns_the_phase_and_leaves_the_magnitude(second_order) -> None:
    truth = second_order()
    found = local_rational_response(truth.record(delay=8), "u", "psi", hold="foh", band=(2.0, 50.0))
    expected = truth.response(found.omega) * np.exp(-1j * 0.04 * found.omega)
    np.testing.assert_allclose(found.values / expected, 1.0, atol=1e-2)
    assert found.phase[-1] == pytest.approx(np.angle(truth.response(found.omega))[-1] - 0.04 * 50.0, abs=0.02)


def test_wider_bands_and_known_rest_lower_the_variance(second_order) -> None:
    record = second_order().record(noise=1e-2, rng=np.random.default_rng(7))
    variances = [
        np.median(local_polynomial_response(record, "u", "psi", band=(20.0, 40.0), **options).variance)
        for options in ({"bandwidth": 3.0}, {"bandwidth": 1.5}, {"bandwidth": 0.6})
    ]
    assert variances[0] < variances[1] < variances[2]


@pytest.mark.parametrize("method", METHODS)
def test_rest_around_a_sweep_saves_its_first_frequencies(second_order, method) -> None:
    truth, rng = second_order(), np.random.default_rng(20)

    def slow_error(rest: float, transient: bool) -> float:
        record = truth.record(noise=1e-3, rng=rng, rest=rest)
        found = method(record, "u", "psi", hold="foh", band=(1.0, 2.0), transient=transient)
        return float(np.sqrt(np.mean(np.abs(found.values - truth.response(found.omega)) ** 2)))

    bare = slow_error(0.0, transient=True)
    assert 20.0 * slow_error(10.0, transient=True) < bare
    assert slow_error(10.0, transient=False) < 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_what_cannot_be_estimated_is_told(second_order, method) -> None:
    record = second_order().record(duration=20.0)
    with pytest.raises(InputError, match=r"too short for a resolution of 0\.5 rad/s. Record at least"):
        method(record, "u", "psi", bandwidth=0.5)
    with pytest.raises(InputError, match="does not excite"):
        method(record, "u", "psi", band=(5.0, 400.0))
    with pytest.raises(InputError, match="no frequency from 1 to"):
        method(record, "u", "psi", band=(1.0, 1.01))
    with pytest.raises(InputError, match="is constant"):
        method(record.with_signals(u=np.zeros(4000)), "u", "psi")
    with pytest.raises(InputError, match="order of a local model"):
        method(record, "u", "psi", order=-1)
    with pytest.raises(InputError, match="spectral lines, fewer than"):
        method(record.slice(0, 10), "u", "psi", band=None)
    with pytest.raises(InputError, match="has no signal 'y'"):
        method(record, "u", "y")


@pytest.mark.parametrize("method", METHODS)
def test_lines_that_are_wanted_are_those_of_the_whole(second_order, method) -> None:
    record = second_order().record(noise=1e-3, rng=np.random.default_rng(4))
    whole = method(record, "u", "psi")
    some = whole.omega[10:400:7]
    found = method(record, "u", "psi", wanted=some)
    assert np.array_equal(found.omega, some)
    assert np.array_equal(found.values, whole.values[10:400:7])
    assert np.array_equal(found.variance, whole.variance[10:400:7])
    with pytest.raises(InputError, match="any of the requested frequencies"):
        method(record, "u", "psi", wanted=some + 1e3)


@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-5])
def test_the_variance_of_a_polynomial_holds_its_bias(second_order, noise: float) -> None:
    truth, turn = second_order(D=0.03), 2.0 * np.pi / 5e-3
    record = truth.record(noise=noise, rng=np.random.default_rng(1), rest=10.0)
    found = local_polynomial_response(record, "u", "psi", hold="foh", band=(2.0, 55.0))
    # A held source shows around multiples of the sampling frequency too.
    around = [found.omega + multiple * turn for multiple in range(-30, 31)]
    sampled = sum(truth.response(omega) * (found.omega / omega) ** 2 for omega in around)
    assert found.bias is not None
    assert np.max(np.abs(found.values - sampled) / np.sqrt(found.variance)) < 4.0
    assert np.max(np.abs(found.values - sampled) / np.sqrt(found.variance - found.bias**2)) > 5.0
