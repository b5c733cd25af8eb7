"""States that cannot leave a range (play, sliders behind springs), against stop operators advanced by hand in tiny steps."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.libraries.library_cache import c_compilers, library, library_suffix
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


STOPPED_TRUTH = """
#include <math.h>
#define ELEMENTS 6
__attribute__((visibility("default")))
void truth(const double *u, long n, double dt, long steps, double stiffness, double damping, double direct, long elements,
           const double *shares, const double *limits, double *out) {
    double h = dt / steps, x = 0.0, v = 0.0, z[ELEMENTS] = {0.0}, spring;
    for (long i = 0; i + 1 < n; i++) {
        for (long j = 0; j < steps; j++) {
            double force = u[i] + (u[i + 1] - u[i]) * (j + 0.5) / steps;
            x += 0.5 * h * v;
            spring = direct * x;
            for (long e = 0; e < elements; e++) {
                z[e] = fmin(fmax(z[e] + 0.5 * h * v, -limits[e]), limits[e]);
                spring += shares[e] * z[e];
            }
            v = (v * (1.0 - 0.5 * h * damping) + h * (force - stiffness * spring)) / (1.0 + 0.5 * h * damping);
            x += 0.5 * h * v;
            for (long e = 0; e < elements; e++) z[e] = fmin(fmax(z[e] + 0.5 * h * v, -limits[e]), limits[e]);
        }
        out[i + 1] = x;
    }
}
"""


def stopped_truth(program, u, stiffness, damping, direct, shares, limits):
    """Leapfrog over a linearly interpolated force; each stop operator is exact for steps without reversal."""
    out = np.zeros(u.size)
    doubles = ctypes.POINTER(ctypes.c_double)

    def pointer(values):
        return np.ascontiguousarray(values, dtype=float).ctypes.data_as(doubles)

    program(
        pointer(u), ctypes.c_long(u.size), ctypes.c_double(DT), ctypes.c_long(STEPS), ctypes.c_double(stiffness),
        ctypes.c_double(damping), ctypes.c_double(direct), ctypes.c_long(limits.size), pointer(shares), pointer(limits),
        out.ctypes.data_as(doubles),
    )  # fmt: skip
    return out


@pytest.fixture(scope="module")
def sweep():
    time = DT * np.arange(4000)
    return np.sin(2.0 * np.pi * (0.2 * time + 0.05 * time**2))


@pytest.fixture(scope="module")
def truths(sweep, axis_values, tmp_path_factory):
    file = tmp_path_factory.mktemp("truth") / f"truth{library_suffix()}"
    file.write_bytes(library(c_compilers()[0], {"truth.c": STOPPED_TRUTH}, ["-O2"]))
    program = ctypes.CDLL(str(file)).truth
    return {
        name: stopped_truth(program, sweep, axis_values["k"], axis_values["d"], direct, shares, limits)
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
