"""What the input does between its samples, and delays, against exact solutions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from rigsight.effects import effect_named
from rigsight.rigs import AXIS
from rigsight.simulate import compose, parameter_vector, record_input, simulate, simulate_sets
from rigsight.simulate.input_hold import hold_input, together

DT = 5e-3


def random_steps(n_samples):
    return np.repeat(np.random.default_rng(1).normal(size=n_samples // 20), 20)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_hold_is_the_exact_discrete_system(hold, axis, axis_values, make_record, error_of):
    samples = random_steps(2000)
    samples[0] = 0.0
    m, d, k = axis_values["m"], axis_values["d"], axis_values["k"]
    continuous = (
        np.array([[0.0, 1.0], [-k / m, -d / m]]),
        np.array([[0.0], [1.0 / m]]),
        np.eye(1, 2),
        np.zeros((1, 1)),
    )
    _, exact, _ = dlsim(cont2discrete(continuous, DT, method=hold), samples[:, None])
    simulated = simulate(axis, axis_values, make_record(samples, dt=DT, hold=hold), accuracy=1e-8)["x"]
    assert error_of(simulated, exact[:, 0]) <= 1e-8


def test_band_limited_input_is_the_analog_signal(axis, axis_values, make_record, error_of):
    """A multisine up to 0.7 of the Nyquist frequency, for which linear interpolation is 16 % off."""
    time = DT * np.arange(3000)
    omega = 2.0 * np.pi * np.array([0.4, 1.7, 11.0, 70.0])
    phase = np.array([0.3, 1.1, 2.0, 0.5])
    samples = np.sin(np.outer(time, omega) + phase).sum(axis=1)
    held = hold_input(samples, DT, "band_limited")
    tau = 0.3 * held.interval
    middle = held.coefficients[1:] @ tau ** np.arange(4)
    fine = np.arange(middle.size) * held.interval + tau
    exact_input = np.sin(np.outer(fine, omega) + phase).sum(axis=1)
    inner = slice(200, -200)
    assert error_of(middle[inner], exact_input[inner]) <= 3e-3

    m, d, k = axis_values["m"], axis_values["d"], axis_values["k"]
    response = 1.0 / (k - m * omega**2 + 1j * d * omega)
    exact = np.imag(np.exp(1j * (np.outer(time, omega) + phase)) @ response)
    record = make_record(samples, dt=DT, hold="band_limited")
    start = np.array([exact[0], np.imag((1j * omega * response * np.exp(1j * phase)).sum())])
    simulated = simulate(axis, axis_values, record, initial_state=start)["x"]
    linear = simulate(axis, axis_values, make_record(samples, dt=DT), initial_state=start)["x"]
    assert error_of(simulated[1500:], exact[1500:]) <= 2e-4
    assert error_of(simulated[1500:], exact[1500:]) <= 0.1 * error_of(linear[1500:], exact[1500:])


@pytest.mark.parametrize(("cycles_per_sample", "per_sample"), [(0.02, 1), (0.2, 2)])
def test_slow_band_limited_input_has_one_piece_per_sample(cycles_per_sample, per_sample, error_of):
    omega = 2.0 * np.pi * cycles_per_sample / DT
    held = hold_input(np.sin(omega * DT * np.arange(2000)), DT, "band_limited")
    assert held.per_sample == per_sample
    for tau in np.array([0.0, 0.25, 0.5, 0.75]) * held.interval:
        between = held.coefficients[1:] @ tau ** np.arange(4)
        exact = np.sin(omega * (np.arange(between.size) * held.interval + tau))
        assert error_of(between[200:-200], exact[200:-200]) <= 2e-3
        if per_sample == 1:
            assert error_of(between[200:-200], exact[200:-200]) <= 1e-5


def test_an_input_replaced_among_others_is_the_same_as_holding_it_with_them():
    samples = np.random.default_rng(3).normal(size=(4, 50)).cumsum(axis=1)
    first, second, third = (
        hold_input(one, DT, hold) for one, hold in zip(samples, ("zoh", "band_limited", "foh"), strict=False)
    )
    slow = hold_input(samples[3], DT, "zoh")
    for before, other in [((first, slow), second), ((first, second), third), ((slow, third), second)]:
        found = together(before).with_input(1, other)
        expected = together((before[0], other))
        assert found.continuous == (expected.continuous and all(one.continuous for one in before))
        times = np.linspace(0.0, 1.0, 7)[:-1] * expected.interval
        parts = found.per_sample // expected.per_sample
        for tau in times:
            piece, own = int(tau / found.interval), tau % found.interval
            at = found.coefficients[1 + piece :: parts] @ own ** np.arange(4)
            np.testing.assert_allclose(at, expected.coefficients[1:] @ tau ** np.arange(4), atol=1e-9)


def test_a_sum_of_inputs_has_the_sum_of_their_values_at_every_time():
    t = DT * np.arange(200)
    slow, fast = np.sin(2.0 * t), np.random.default_rng(3).normal(size=t.size)
    one, other = (hold_input(signal, DT, "band_limited") for signal in (slow, fast))
    assert (one.per_sample, other.per_sample) == (1, 2)
    for found in (one.plus(other), other.plus(one)):
        assert found.per_sample == 2
        for tau in np.array([0.0, 0.6]) * found.interval:
            first, second = (
                found.coefficients[1 + piece :: 2] @ tau ** np.arange(4)
                - other.coefficients[1 + piece :: 2] @ tau ** np.arange(4)
                for piece in (0, 1)
            )
            slow_at = [
                one.coefficients[1:] @ (tau + piece * found.interval) ** np.arange(4) for piece in (0, 1)
            ]
            np.testing.assert_allclose([first, second], slow_at, atol=1e-12)


@pytest.mark.parametrize("hold", ["zoh", "foh", "band_limited"])
@pytest.mark.parametrize("periods", [0, 1, 7])
def test_delay_by_whole_samples_shifts_the_response(
    hold, periods, axis, axis_with_delay, axis_values, make_record
):
    samples = random_steps(600)
    record = make_record(samples, dt=DT, hold=hold)
    plain = simulate(axis, axis_values, record, accuracy=1e-9)["x"]
    late = simulate(axis_with_delay, {**axis_values, "T_d": periods * DT}, record, accuracy=1e-9)["x"]
    np.testing.assert_allclose(
        late[periods:], plain[: plain.size - periods], atol=1e-9 * np.max(np.abs(plain))
    )
    np.testing.assert_allclose(late[:periods], plain[0], rtol=1e-9)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_delay_by_a_fraction_of_a_sample(hold, axis, axis_with_delay, axis_values, make_record):
    """A four times finer record of the same input, shifted by whole fine samples, is the reference."""
    samples = random_steps(600)
    fine = (
        np.repeat(samples, 4)[:-3]
        if hold == "zoh"
        else np.interp(np.arange(2397), 4 * np.arange(600), samples)
    )
    shift = 13
    late_fine = np.concatenate([np.full(shift, samples[0]), fine[:-shift]])
    exact = simulate(axis, axis_values, make_record(late_fine, dt=DT / 4, hold=hold), accuracy=1e-9)["x"][::4]
    record = make_record(samples, dt=DT, hold=hold)
    late = simulate(axis_with_delay, {**axis_values, "T_d": shift * DT / 4}, record, accuracy=1e-9)["x"]
    np.testing.assert_allclose(late, exact, atol=1e-8 * np.max(np.abs(exact)))


def test_lanes_delay_each_set_by_its_own_time(axis_with_delay, axis_values, make_record, error_of):
    record = make_record(np.sin(0.05 * np.arange(800)), dt=DT)
    held = record_input(axis_with_delay, record)
    delays = [0.0, 0.3 * DT, DT, 4.7 * DT, 1.0]
    sets = [{**axis_values, "T_d": delay} for delay in delays]
    p = np.stack([parameter_vector(axis_with_delay, values) for values in sets], axis=1)
    out = simulate_sets(axis_with_delay, held, p, np.zeros((2, len(delays))), 800, 2)
    for i, values in enumerate(sets):
        exact = simulate(axis_with_delay, values, record)["x"]
        assert error_of(out[:, 0, i], exact) <= 1e-5


def test_held_input_reaches_a_limit_at_a_jump(axis, axis_values, make_record, error_of):
    """A jump across a limit takes effect at once, so that clipped samples give the same motion."""
    structure = compose(AXIS, [effect_named("input_saturation")])
    samples = random_steps(800)
    exact = simulate(axis, axis_values, make_record(np.clip(samples, -0.6, 0.6), hold="zoh"))["x"]
    limited = simulate(structure, {**axis_values, "u_max": 0.6}, make_record(samples, hold="zoh"))["x"]
    assert error_of(limited, exact) <= 1e-6
