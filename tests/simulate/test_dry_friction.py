"""Sticking and slipping against a closed form and an independent event-driven reference."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from rigsight.simulate import parameter_vector, record_input, simulate, simulate_sets

DT = 5e-3


def free_decay(time, start, frequency, center):
    """Coulomb-damped free oscillator: half-periods around +-center, then stuck within it."""
    x = np.full(time.size, np.nan)
    turning = start
    half = np.pi / frequency
    for i in range(1000):
        inside = time >= i * half
        if abs(turning) <= center:
            x[inside] = turning
            return x
        middle = np.sign(turning) * center
        x[inside] = middle + (turning - middle) * np.cos(frequency * (time[inside] - i * half))
        turning = 2.0 * middle - turning
    raise AssertionError


def test_free_oscillation_loses_a_fixed_amplitude_per_period(
    axis_with_friction, axis_values, make_record, error_of
):
    values = {**axis_values, "d": 0.0, "T_c": 0.7}
    record = make_record(np.zeros(2000), dt=DT)
    simulated = simulate(axis_with_friction, values, record, initial_state=np.array([0.1, 0.0]))["x"]
    exact = free_decay(record.t, 0.1, 10.0, 0.007)
    assert error_of(simulated, exact) <= 1e-6
    assert simulated[-1] == simulated[-500]
    assert abs(simulated[-1]) <= 0.007


def stick_slip_truth(values, samples, dt):
    """Mass on a spring with dry friction under a linearly interpolated force."""
    m, d, k, friction = values["m"], values["d"], values["k"], values["T_c"]
    out = np.zeros(samples.size)
    x, v, direction = 0.0, 0.0, 0
    for i in range(samples.size - 1):
        first, slope = samples[i], (samples[i + 1] - samples[i]) / dt
        t = 0.0
        while t < dt:
            if direction == 0:
                leave = [
                    (crossing, sign)
                    for sign in (1, -1)
                    if sign * (first + slope * t - k * x) > friction - 1e-14 and sign * slope > 0.0
                    for crossing in (t,)
                ]
                if slope != 0.0 and not leave:
                    for sign in (1, -1):
                        crossing = (k * x + sign * friction - first) / slope
                        if t < crossing < dt and sign * slope > 0.0:
                            leave.append((crossing, sign))
                if not leave:
                    break
                t, direction = min(leave)
            sign = direction

            def rates(s, state, first=first, slope=slope, sign=sign):
                return state[1], (first + slope * s - k * state[0] - d * state[1] - sign * friction) / m

            def stopped(_, state):
                return state[1]

            stopped.terminal, stopped.direction = True, -sign
            solution = solve_ivp(
                rates, (t, dt), (x, v), method="DOP853", rtol=1e-11, atol=1e-15, events=stopped
            )
            t, (x, v) = solution.t[-1], solution.y[:, -1]
            if solution.t_events[0].size:
                v = 0.0
                balance = first + slope * t - k * x
                direction = 0 if abs(balance) <= friction else int(np.sign(balance))
        out[i + 1] = x
    return out


def driven_case(axis_values):
    time = DT * np.arange(2400)
    values = {**axis_values, "T_c": 1.5}
    # Twice the friction at a slow pace: long sticks; the second tone makes double reversals.
    return values, 3.0 * np.sin(1.3 * time) + 1.0 * np.sin(7.1 * time)


def test_stick_slip_meets_the_reference(axis_with_friction, axis_values, make_record, error_of):
    values, force = driven_case(axis_values)
    exact = stick_slip_truth(values, force, DT)
    assert np.mean(np.diff(exact) == 0.0) > 0.05
    assert error_of(simulate(axis_with_friction, values, make_record(force, dt=DT))["x"], exact) <= 1e-6


def test_lanes_stick_and_slip(axis_with_friction, axis_values, make_record, error_of):
    values, force = driven_case(axis_values)
    record = make_record(force, dt=DT)
    exact = simulate(axis_with_friction, values, record, accuracy=1e-8)["x"]
    held = record_input(axis_with_friction, record)
    p = parameter_vector(axis_with_friction, values)[:, None]
    errors = [
        error_of(simulate_sets(axis_with_friction, held, p, np.zeros((2, 1)), force.size, n)[:, 0, 0], exact)
        for n in (1, 4)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < 1e-4


def test_small_force_moves_nothing(axis_with_friction, axis_values, make_record):
    force = np.sin(0.05 * np.arange(500))
    simulated = simulate(axis_with_friction, {**axis_values, "T_c": 1.01}, make_record(force))["x"]
    assert np.all(simulated == 0.0)


def test_step_of_a_held_input_breaks_loose(axis_with_friction, axis_values, make_record):
    force = np.where(np.arange(400) < 100, 0.0, 3.0)
    simulated = simulate(axis_with_friction, {**axis_values, "T_c": 1.0}, make_record(force, hold="zoh"))["x"]
    assert np.all(simulated[:101] == 0.0)
    assert simulated[101] > 0.0
    # Until its first reversal a mass under dry friction is a linear oscillator with a smaller force.
    time = DT * np.arange(1, 20)
    frequency, decay = np.sqrt(100.0 - 0.3**2), 0.3
    exact = 0.02 * (
        1.0
        - np.exp(-decay * time) * (np.cos(frequency * time) + decay / frequency * np.sin(frequency * time))
    )
    np.testing.assert_allclose(simulated[101:120], exact, rtol=1e-5)
