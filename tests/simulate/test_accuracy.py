"""Both integrators against an independent truth: DOP853 restarted at every sample, equations written by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from rigsight.effects import effect_named
from rigsight.errors import SimulationError
from rigsight.excitation import log_sweep
from rigsight.records import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import (
    compose,
    parameter_vector,
    record_input,
    rest_state,
    simulate,
    simulate_outputs,
    simulate_sets,
)
from rigsight.simulate.side_by_side import choose_substeps  # fmt: skip

SETS = ("R", "B", "P", "stiff")
DT = 5e-3
GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25, "c_y": 0.98, "psi_off": 0.0, "y_off": 0.0,
}  # fmt: skip


def hysteretic_truth(values, samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Yaw angle for a linearly interpolated current."""
    torque_per_ampere = values["b"] * values["k_tau"] / values["r_0"]
    inertia, stiffness, damping = values["J_z"], values["k_c"], values["k_d"]
    A, a, beta, gamma = (values[name] for name in ("A", "a", "beta", "gamma"))
    yaw = np.zeros(samples.size)
    state = np.zeros(3)
    for i in range(samples.size - 1):
        first, slope = samples[i], (samples[i + 1] - samples[i]) / DT

        def rates(t, state, first=first, slope=slope):
            psi, w, z = state
            spring = stiffness * (a * psi + (1.0 - a) * z)
            return (
                w,
                (torque_per_ampere * (first + slope * t) - damping * w - spring) / inertia,
                A * w - beta * abs(w) * z - gamma * w * abs(z),
            )

        state = solve_ivp(rates, (0.0, DT), state, method="DOP853", rtol=1e-10, atol=1e-14).y[:, -1]
        yaw[i + 1] = state[0]
    return yaw


@pytest.fixture(scope="module")
def truths(hysteresis_sets, sweep):
    return {name: hysteretic_truth(hysteresis_sets[name], sweep) for name in SETS}


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_default_accuracy_is_met_on_the_published_hysteresis(
    name, hysteretic, hysteresis_sets, sweep, truths, make_record, error_of
):
    simulated = simulate(hysteretic, hysteresis_sets[name], make_record(sweep))
    assert error_of(simulated["psi"], truths[name]) <= 1e-6


@pytest.mark.parametrize("accuracy", [1e-4, 1e-5, 1e-7])
def test_accuracy_wish_is_met(accuracy, hysteretic, hysteresis_sets, sweep, truths, make_record, error_of):
    for name in SETS:
        simulated = simulate(hysteretic, hysteresis_sets[name], make_record(sweep), accuracy=accuracy)
        assert error_of(simulated["psi"], truths[name]) <= accuracy


@pytest.mark.parametrize(
    ("effect", "own"),
    [
        ("stribeck_friction", {"T_c": 5.7, "T_s": 8.3, "w_s": 0.12}),
        ("bouc_wen_hysteresis", {"A": 1.0, "a": 0.05, "beta": 900.0, "gamma": -100.0, "n": 1.0}),
        ("end_stop", {"k_s": 5e3, "s": 0.2}),
    ],
)
def test_the_default_holds_where_friction_stops_and_loops_are_wide(effect, own, make_record, error_of):
    structure = compose(AXIS, [effect_named(effect)])
    values = {"gain": 140.0, "m": 2.14, "d": 12.3, "k": 364.0, "x_off": -0.02, "force_off": 0.0, **own}
    record = make_record(log_sweep(DT * np.arange(8000), 1.0, 1.0, 80.0))
    accurate = simulate(structure, values, record, accuracy=1e-10)
    assert error_of(simulate(structure, values, record)["x"], accurate["x"]) <= 1e-6


def prepared(structure, values, record):
    held = record_input(structure, record)
    p = parameter_vector(structure, values)
    return held, p, rest_state(structure, p, held)


LIGHT = {"gain": 1.0, "m": 1e-3, "d": 0.03, "k": 1e4, "x_off": 0.0, "force_off": 0.0}
"""Swings ten times between two samples at 50 Hz."""


def test_a_rig_that_swings_many_times_between_two_samples(make_record, error_of):
    structure = compose(AXIS, [effect_named("actuator_lag")])
    record = make_record(np.sin(3.0 * 0.02 * np.arange(200)), dt=0.02, hold="zoh")
    simulated = simulate(structure, {**LIGHT, "T_a": 0.01}, record)["x"]
    m, d, k = (LIGHT[name] for name in "mdk")
    rates = np.array([[0.0, 1.0, 0.0], [-k / m, -d / m, 1.0 / m], [0.0, 0.0, -100.0]])
    step = cont2discrete((rates, np.array([[0.0], [0.0], [100.0]]), np.eye(3), np.zeros((3, 1))), 0.02)
    state, exact = np.zeros(3), np.zeros(record.n_samples)
    for i, u in enumerate(record["u"][:-1]):
        state = step[0] @ state + step[1][:, 0] * u
        exact[i + 1] = state[0]
    assert error_of(simulated, exact) <= 1e-6


def test_sliders_of_a_light_rig_hold_it(make_record, error_of):
    structure = compose(AXIS, [effect_named("iwan_hysteresis")])
    record = make_record(0.06 * np.sin(3.0 * 0.02 * np.arange(60)), dt=0.02, hold="zoh")
    values = {**LIGHT, "m": 8e-4, "d": 6e-3, "k": 1e3, "a": 1e-3, "x_s": 1.7e-3, "q": -0.7}
    held, p, state = prepared(structure, values, record)
    fixed = simulate_sets(structure, held, p[:, None], state[:, None], record.n_samples, 2000)[:, 0, 0]
    assert error_of(simulate_outputs(structure, held, p, state, record.n_samples)[:, 0], fixed) <= 1e-5


def test_lanes_converge_to_the_truth(hysteretic, hysteresis_sets, sweep, truths, make_record, error_of):
    record = make_record(sweep)
    prepared_sets = [prepared(hysteretic, hysteresis_sets[name], record) for name in SETS]
    held = prepared_sets[0][0]
    p = np.stack([p for _, p, _ in prepared_sets], axis=1)
    states = np.stack([state for _, _, state in prepared_sets], axis=1)
    errors = []
    for substeps in (2, 8, 32):
        out = simulate_sets(hysteretic, held, p, states, record.n_samples, substeps)
        errors.append([error_of(out[:, 0, i], truths[name]) for i, name in enumerate(SETS)])
    # Kinks are not events in the lanes, so second order is what is left of Runge-Kutta's fourth.
    assert np.all(np.array(errors[0]) > 8.0 * np.array(errors[1]))
    assert np.all(np.array(errors[1]) > 4.0 * np.array(errors[2]))
    assert np.all(np.array(errors[2]) < 3e-6)


def test_lanes_are_of_fourth_order_where_the_model_is_smooth(axis, axis_values, make_record):
    time = 0.05 * np.arange(400)
    held, p, state = prepared(axis, axis_values, make_record(np.sin(2.0 * time), dt=0.05))
    exact = simulate_outputs(axis, held, p, state, time.size, accuracy=1e-10)
    errors = [
        np.max(np.abs(simulate_sets(axis, held, p[:, None], state[:, None], time.size, n)[:, :, 0] - exact))
        for n in (2, 4, 8)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 4.0) < 0.3)


def test_chosen_substeps_reach_the_wish(hysteretic, hysteresis_sets, sweep, truths, make_record, error_of):
    record = make_record(sweep)
    chosen = []
    for name in SETS:
        held, p, state = prepared(hysteretic, hysteresis_sets[name], record)
        substeps = choose_substeps(hysteretic, held, p, state, record.n_samples, 1e-4)
        out = simulate_sets(hysteretic, held, p[:, None], state[:, None], record.n_samples, substeps)
        assert error_of(out[:, 0, 0], truths[name]) <= 1.3e-4
        chosen.append(substeps)
    assert max(chosen) <= 16


def test_steps_that_run_away_do_not_tell_how_many_are_needed(axis) -> None:
    # A servo at 50 Hz whose mass answers within 2 ms: of the numbers tried some leave the range of numbers, some nearly.
    values = {"gain": 1.0, "m": 1.9e-4, "d": 0.082, "k": 1.0, "x_off": 0.0, "force_off": 0.0}
    u = lfilter([0.15], [1.0, -0.85], np.random.default_rng(1).normal(size=3000))
    held, p, state = prepared(axis, values, Record("servo", 0.02, {"u": u}, {}, hold="zoh"))
    substeps = choose_substeps(axis, held, p, state, u.size, 1e-3)
    assert substeps <= 8
    exact = simulate_outputs(axis, held, p, state, u.size, 1e-6)
    out = simulate_sets(axis, held, p[:, None], state[:, None], u.size, substeps)[:, :, 0]
    assert np.std(out - exact) <= 1e-3 * np.std(exact)


def test_a_state_that_rests_does_not_hide_that_steps_are_too_long() -> None:
    """A free decay: the lag of the drive, a fifth of a sample, answers to nothing but its own state."""
    structure = compose(AXIS, [effect_named("actuator_lag")])
    values = {"gain": 1.0, "m": 2.5, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0, "T_a": 1e-3}
    held, p, _ = prepared(structure, values, Record("decay", DT, {"u": np.zeros(600)}, {}, hold="zoh"))
    decaying, moved = np.array([0.1, 0.0, 0.0]), np.array([0.1, 0.0, 1e-6])
    substeps = choose_substeps(structure, held, p, decaying, 600, 1e-3)
    out = simulate_sets(structure, held, p[:, None], moved[:, None], 600, substeps)
    assert np.max(np.abs(out)) < 1.0


@pytest.mark.parametrize("effect", ["bouc_wen_hysteresis", "coulomb_friction", "iwan_hysteresis"])
def test_sets_do_not_depend_on_their_neighbors(effect, hysteresis_sets, sweep, make_record):
    record = make_record(sweep[:1500])
    structure = compose(RUNNING_GEAR, [effect_named(effect)])
    own = {"T_c": 0.02, "x_s": 2e-3, "q": -0.4, "n": 1.0}
    held, p, state = prepared(structure, {**hysteresis_sets["R"], **own}, record)
    factors = np.random.default_rng(3).uniform(0.8, 1.2, 37)
    index = structure.names.index("k_c")
    many = np.repeat(p[:, None], factors.size, axis=1)
    many[index] *= factors
    states = np.repeat(state[:, None], factors.size, axis=1)
    together = simulate_sets(structure, held, many, states, record.n_samples, 4)
    assert together.shape == (1500, 2, 37)
    for i in (0, 15, 16, 36):
        alone = simulate_sets(structure, held, many[:, i : i + 1], states[:, :1], record.n_samples, 4)
        np.testing.assert_array_equal(together[:, :, i], alone[:, :, 0])


def test_unstable_model_is_an_error_not_nan(hysteretic, hysteresis_sets, sweep, make_record):
    values = {**hysteresis_sets["R"], "beta": -1e7}
    with pytest.raises(SimulationError, match="bouc_wen_hysteresis"):
        simulate(hysteretic, values, make_record(sweep))


def test_diverging_lane_leaves_its_neighbors_alone(hysteretic, hysteresis_sets, sweep, make_record):
    record = make_record(sweep)
    held, p, state = prepared(hysteretic, hysteresis_sets["R"], record)
    both = np.stack([p, p], axis=1)
    both[hysteretic.names.index("beta"), 1] = -1e7
    out = simulate_sets(hysteretic, held, both, np.stack([state, state], axis=1), record.n_samples, 8)
    assert np.all(np.isfinite(out[:, :, 0]))
    assert not np.all(np.isfinite(out[:, :, 1]))


def test_what_is_to_come_does_not_change_what_was(axis, axis_values, make_record):
    samples = np.sin(0.05 * np.arange(400)) * np.repeat([1e-3, 1.0], 200)
    whole = simulate(axis, axis_values, make_record(samples))["x"]
    part = simulate(axis, axis_values, make_record(samples[:200]))["x"]
    np.testing.assert_array_equal(whole[:199], part[:199])


def test_a_rig_at_rest_behind_a_dead_zone_is_not_resolved_to_rounding(make_record):
    structure = compose(RUNNING_GEAR, [effect_named("input_dead_zone")])
    values = {**GEAR_VALUES, "u_0": 0.2}
    late = np.sin(np.arange(161) * 0.02) * np.linspace(0.0, 1.0, 161)
    assert np.ptp(simulate(structure, values, make_record(late), accuracy=1e-9)["psi"]) > 1e-3
    quiet = simulate(structure, values, make_record(0.19 * np.sin(0.3 * np.arange(161))), accuracy=1e-9)
    assert np.max(np.abs(quiet["psi"])) <= 1e-15
