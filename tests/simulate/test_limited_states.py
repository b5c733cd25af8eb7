"""States that cannot leave a range (play, sliders behind springs), against stop operators advanced by hand in tiny steps."""

from __future__ import annotations

import numpy as np
import pytest
from numba import njit

from rigsight.effects import effect_named
from rigsight.records.record import Record
from rigsight.rigs import AXIS, ELEMENT
from rigsight.simulate import compose, parameter_vector, record_input, rest_state, simulate, simulate_sets

DT = 5e-3
STEPS = 400
SLIP = 0.03 * 10.0 ** (-2.7 * (11.0 - 2.0 * np.arange(6)) / 12.0)
WEIGHTS = SLIP**-0.4 / np.sum(SLIP**-0.4)
CASES = {
    "iwan_hysteresis": ({"a": 0.2, "x_s": 0.03, "q": -0.4}, 0.2, 0.8 * WEIGHTS, SLIP),
    "backlash": ({"g": 0.01}, 1.0, np.array([-1.0]), np.array([0.01])),
}
"""Effect -> its values, share of the stiffness on the displacement itself, shares on the stopped states, their limits."""


@njit
def stopped_truth(u, stiffness, damping, direct, shares, limits):
    """Leapfrog over a linearly interpolated force; each stop operator is exact for steps without reversal."""
    h = DT / STEPS
    x, v = 0.0, 0.0
    z = np.zeros(limits.size)
    out = np.zeros(u.size)
    for i in range(u.size - 1):
        for j in range(STEPS):
            force = u[i] + (u[i + 1] - u[i]) * (j + 0.5) / STEPS
            x += 0.5 * h * v
            spring = direct * x
            for e in range(z.size):
                z[e] = min(max(z[e] + 0.5 * h * v, -limits[e]), limits[e])
                spring += shares[e] * z[e]
            v = (v * (1.0 - 0.5 * h * damping) + h * (force - stiffness * spring)) / (1.0 + 0.5 * h * damping)
            x += 0.5 * h * v
            for e in range(z.size):
                z[e] = min(max(z[e] + 0.5 * h * v, -limits[e]), limits[e])
        out[i + 1] = x
    return out


@pytest.fixture(scope="module")
def sweep():
    time = DT * np.arange(4000)
    return np.sin(2.0 * np.pi * (0.2 * time + 0.05 * time**2))


@pytest.fixture(scope="module")
def truths(sweep, axis_values):
    return {
        name: stopped_truth(sweep, axis_values["k"], axis_values["d"], direct, shares, limits)
        for name, (_, direct, shares, limits) in CASES.items()
    }


@pytest.mark.parametrize("name", CASES)
def test_accurate_integrator_meets_its_accuracy(name, sweep, truths, axis_values, make_record, error_of):
    values = {**axis_values, **CASES[name][0]}
    simulated = simulate(compose(AXIS, [effect_named(name)]), values, make_record(sweep))
    assert error_of(simulated["x"], truths[name]) <= 1e-6


@pytest.mark.parametrize("name", CASES)
def test_lanes_converge_to_the_truth(name, sweep, truths, axis_values, make_record, error_of):
    structure = compose(AXIS, [effect_named(name)])
    held = record_input(structure, make_record(sweep))
    p = parameter_vector(structure, {**axis_values, **CASES[name][0]})
    state = rest_state(structure, p, held)
    errors = [
        error_of(
            simulate_sets(structure, held, p[:, None], state[:, None], sweep.size, n)[:, 0, 0], truths[name]
        )
        for n in (2, 8, 32)
    ]
    assert errors[0] > 8.0 * errors[1] > 32.0 * errors[2]
    assert errors[2] < 1e-5


def test_hysteresis_behind_backlash_sees_what_is_left_of_the_motion():
    """A slow motion within the play moves no spring; a larger one leaves it behind by the play."""
    structure = compose(ELEMENT, [effect_named("backlash"), effect_named("bouc_wen_hysteresis")], {"n": 1.0})
    values = {
        "k": 100.0,
        "d": 0.0,
        "force_off": 0.0,
        "g": 0.01,
        "A": 1.0,
        "a": 0.5,
        "beta": 30.0,
        "gamma": 10.0,
    }
    phase = np.linspace(0.0, 1.5 * np.pi, 3001)

    def force(amplitude):
        motion = Record(
            "slow", dt=0.01, signals={"x": amplitude * np.sin(phase)}, units={"x": "x"}, hold="foh"
        )
        return simulate(structure, values, motion)["force"]

    np.testing.assert_allclose(force(0.009), 0.0, atol=1e-12)
    top = 0.05 - 0.01
    at_top = 100.0 * (0.5 * top + 0.5 * (1.0 - np.exp(-40.0 * top)) / 40.0)
    beyond = force(0.05)
    assert beyond[1000] == pytest.approx(at_top, rel=1e-5)
    # After the reversal the spring waits until the motion has crossed the play the other way.
    waiting = (phase > 0.5 * np.pi) & (0.05 * np.sin(phase) > 0.03)
    np.testing.assert_allclose(beyond[waiting], at_top, rtol=1e-5)
    assert beyond[np.flatnonzero(waiting)[-1] + 100] < 0.95 * at_top
