"""Does a linearized motion answer to parameters and states as the simulated one does?"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from rigsight.discover.linearized_motion import MotionEquations
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate import compose, simulate

DT, N = 5e-3, 600
ARM = {"I_1": 0.05, "I_2": 0.02, "m_2": 0.6, "s_1": 0.12, "s_2": 0.08, "d_1": 0.05, "d_2": 0.02}


@pytest.fixture(scope="module")
def run(two_link_arm: Rig) -> Record:
    t = DT * np.arange(N)
    inputs = {"tau_1": 0.5 * np.sin(9.0 * t), "tau_2": 0.2 * np.sin(14.0 * t)}
    record = Record("run", DT, inputs, {}, hold="foh")
    return simulate(compose(two_link_arm), ARM, record, np.zeros(4), accuracy=1e-10)


def states_of(run: Record) -> np.ndarray:
    angles = np.column_stack([run["angle_1"], run["angle_2"]])
    return np.hstack([angles, make_interp_spline(run.t, angles, k=5).derivative()(run.t)])


def test_a_motion_of_the_equations_has_no_defect_and_no_residual(two_link_arm: Rig, run: Record) -> None:
    linear = MotionEquations(compose(two_link_arm), ["I_1"]).about(run, ARM, states_of(run))
    assert np.max(np.abs(linear.residual)) < 1e-12
    assert np.max(np.abs(linear.defect[:, :2])) < 1e-8
    assert np.max(np.abs(linear.defect[:, 2:])) < 1e-6


@pytest.mark.parametrize("name", ["I_1", "s_2", "d_2"])
def test_a_changed_parameter_moves_it_as_the_simulation(two_link_arm: Rig, run: Record, name: str) -> None:
    step = 1e-6 * ARM[name]
    moved = simulate(compose(two_link_arm), {**ARM, name: ARM[name] + step}, run, np.zeros(4), accuracy=1e-10)
    linear = MotionEquations(compose(two_link_arm), [name]).about(run, ARM, states_of(run))
    state, course = np.zeros(4), [np.zeros(4)]
    for transition, response in zip(linear.transition, linear.by_parameter, strict=True):
        state = transition @ state + step * response[:, 0]
        course.append(state)
    expected = moved["angle_1"] - run["angle_1"]
    assert np.max(np.abs(np.array(course)[:, 0] - expected)) < 1e-4 * np.max(np.abs(expected))


def test_a_reading_that_is_missing_is_no_residual(two_link_arm: Rig, run: Record) -> None:
    alone = Record("alone", DT, {n: run[n] for n in ("tau_1", "tau_2", "angle_2")}, {}, hold="foh")
    linear = MotionEquations(compose(two_link_arm), []).about(alone, ARM, states_of(run))
    assert np.all(np.isnan(linear.residual[:, 0]))
    assert np.all(np.isfinite(linear.residual[:, 1]))
