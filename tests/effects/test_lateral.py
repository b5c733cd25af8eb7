"""What the effects of the lateral motion promise, measured on the running gear."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rigsight.effects import CATALOGUE, GainTrend, Place
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import compose, simulate

VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 6.0, "l_0": 0.25, "c_y": 0.98,
    "psi_off": 1e-3, "y_off": -2e-4,
}  # fmt: skip
OMEGA, PER_PERIOD = 4.0, 200
LATERAL = [effect for effect in CATALOGUE if effect.place is Place.LATERAL_DYNAMICS]
each_lateral_effect = pytest.mark.parametrize("effect", LATERAL, ids=lambda effect: effect.name)
STRENGTH = {"creep_saturation": {"s": 0.01}, "conicity_variation": {"y_n": 0.004}}


def sine(amplitude, n_periods=20):
    dt = 2.0 * np.pi / OMEGA / PER_PERIOD
    t = dt * np.arange(n_periods * PER_PERIOD + 1)
    return Record("sine", dt, {"u": amplitude * np.sin(OMEGA * t)}, {"u": "A"})


@each_lateral_effect
def test_the_yaw_motion_is_untouched_and_null_gives_the_rig_exactly(effect):
    plain = simulate(compose(RUNNING_GEAR), VALUES, sine(1.0))
    structure = compose(RUNNING_GEAR, [effect])
    strong = simulate(structure, {**VALUES, **STRENGTH[effect.name]}, sine(1.0))
    np.testing.assert_allclose(strong["psi"], plain["psi"], atol=1e-6 * np.std(plain["psi"]))
    assert np.std(strong["y"] - plain["y"]) > 0.05 * np.std(plain["y"])
    null = simulate(structure, {**VALUES, **effect.null_values()}, sine(1.0))
    np.testing.assert_array_equal(null["y"], plain["y"])


@each_lateral_effect
def test_the_lateral_gain_falls_with_amplitude_and_harmonics_are_odd(effect):
    gains, even = [], []
    for amplitude in (0.3, 1.0):
        values = {**VALUES, **STRENGTH[effect.name], "psi_off": 0.0, "y_off": 0.0}
        y = simulate(compose(RUNNING_GEAR, [effect]), values, sine(amplitude))["y"][-PER_PERIOD - 1 : -1]
        lines = np.abs(np.fft.rfft(y))
        gains.append(lines[1] / amplitude)
        even.append(lines[2] / lines[1])
    assert effect.signature.gain_trend is GainTrend.FALLS
    assert gains[1] < 0.99 * gains[0]
    assert max(even) < 1e-3
    assert not effect.signature.even_harmonics


@each_lateral_effect
def test_the_lateral_motion_is_that_of_the_equation(effect):
    """Driven by the simulated yaw angle, an independent integrator gives the same displacement."""
    record = sine(1.0, 3)
    values = {**VALUES, **STRENGTH[effect.name]}
    simulated = simulate(compose(RUNNING_GEAR, [effect]), values, record)
    psi = simulated["psi"]
    gain, feedback = values["v"] * values["c_y"], 0.5 / values["l_0"]

    def rate(t, y):
        aside = y - values["y_off"]
        angle = np.interp(t, record.t, psi)
        if effect.name == "creep_saturation":
            return gain * values["s"] * np.tanh((angle - aside * feedback) / values["s"])
        return gain * (angle - aside * (1.0 + (aside / values["y_n"]) ** 2) * feedback)

    truth = solve_ivp(
        rate, (0.0, record.t[-1]), [simulated["y"][0]], t_eval=record.t, rtol=1e-8, atol=1e-12
    ).y[0]
    np.testing.assert_allclose(simulated["y"], truth, atol=2e-4 * np.std(truth))


def test_an_axis_has_no_lateral_motion():
    assert LATERAL
    assert not any(AXIS.offers(effect) for effect in LATERAL)
