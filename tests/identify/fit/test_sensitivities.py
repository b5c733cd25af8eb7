"""The derivatives that fits take are those of the accurate simulation, for every effect on both driven rigs."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.effects import CATALOGUE, Effect, effect_named, placed
from rigsight.excitation import log_sweep
from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.fit_problem import Problem
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.start.scales import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS, RUNNING_GEAR, Rig
from rigsight.simulate import Substeps, carries_tangents, compose, simulate, simulate_outputs
from rigsight.simulate.equations.kinks import freeze
from rigsight.units import characteristic_value
from rigsight.workflow.own.effect_benches import AXIS_BENCH, GEAR_BENCH

DT, N_SAMPLES = 5e-3, 600
STEP = 3e-5
"""Of the central differences: they are right to about 1e-6 with it, as those of three times and a third of it tell."""
SUBSTEPS = 32
"""Steps in a sample, as this slow input has one piece there: what is left of the error of an output is far below that of a
derivative."""
SMOOTH, LATE, KINKED = 1e-5, 5e-4, 1e-2
"""Largest relative error of a derivative.

Differences over 1e-6 are off by some of it, over 1e-4 where a sensor is late by some hundreds. A kink within a step is not
located: outputs are right to the square of the step all the same, derivatives to the step, a hundredth of the fastest period.
"""


def drawn(rig: Rig, effect: Effect) -> tuple[Problem, NDArray[np.float64]]:
    """Return a fit of an effect's own simulation, and the coordinates of the truth with all states off zero."""
    bench = AXIS_BENCH if rig is AXIS else GEAR_BENCH
    t = DT * np.arange(N_SAMPLES)
    record = Record("sweep", DT, {"u": log_sweep(t, 1.0, 1.0, 40.0)}, {"u": "A"}, hold="band_limited")
    plain = simulate(compose(rig), bench.swept, record)
    scales = characteristic_scales(rig, [plain], bench.swept)
    structure = compose(rig, [effect])
    size = {p.name: characteristic_value(p.dimension, scales) for p in effect.parameters}
    given = {p.name: p.default for p in effect.parameters if p.default is not None}
    own = {p.name: p.starts[0] * size[p.name] for p in effect.parameters if p.starts}
    # Not where a power vanishes.
    values = {**bench.swept, **given, **own, **({"n": 1.4} if "n" in own else {})}
    free = [*bench.free, *(p.name for p in effect.parameters if p.fitted)]
    simulated = simulate(structure, values, record)
    fit = GreyBoxFit(structure, [simulated], scales, {s.name: 1.0 for s in rig.outputs}, accuracy=1e-6)
    coordinates = Coordinates.of(structure, free, values, scales)
    n_states = len(structure.states)
    problem = Problem(fit.data, coordinates, n_states, np.append(coordinates.upper, np.full(n_states, 20.0)))
    theta = np.append(coordinates.from_values(values), np.where(fit.data.limited, 0.3, 0.02))
    problem.substeps = [Substeps(SUBSTEPS)]
    return problem, theta


def central(problem: Problem, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return derivatives of the residuals by central differences of the accurate simulation."""
    structure, record = problem.data.structure, problem.data.records[0]

    def outputs(place: NDArray[np.float64]) -> NDArray[np.float64]:
        p = problem.coordinates.to_parameters(place[: problem.n_free])
        state = problem.states(place)[0]
        return simulate_outputs(structure, record.held, p, state, N_SAMPLES, 1e-10).T.ravel()

    steps = STEP * np.eye(theta.size)
    return np.array([(outputs(theta - step) - outputs(theta + step)) / (2.0 * STEP) for step in steps]).T


CASES = [
    pytest.param(
        rig,
        effect,
        id=f"{rig.name}-{effect.name}",
        marks=pytest.mark.slow if rig is RUNNING_GEAR and AXIS.offers(effect) else (),
    )
    for rig in (RUNNING_GEAR, AXIS)
    for effect in CATALOGUE
    if rig.offers(effect)
]
"""`make test` takes each effect on one rig."""


@pytest.mark.parametrize(("rig", "effect"), CASES)
def test_derivatives_are_those_of_the_accurate_simulation(rig: Rig, effect: Effect) -> None:
    problem, theta = drawn(rig, effect)
    _, found = problem.sensitivities(theta)[0]
    expected = central(problem, theta)
    size = np.linalg.norm(expected, axis=0)
    error = np.linalg.norm(found - expected, axis=0)
    structure = problem.data.structure
    limit = KINKED if freeze(structure).modes else SMOOTH if structure.first_shown_late is None else LATE
    assert np.all(error <= limit * size), dict(
        zip((*problem.coordinates.free, *structure.state_names), error / size, strict=True)
    )


@pytest.mark.parametrize(
    "name", ["coulomb_friction", "gravity_pendulum", "cubic_stiffness", "backlash", "sensor_delay"]
)
def test_the_equations_of_a_step_are_made_of_the_derivatives(name: str) -> None:
    problem, theta = drawn(AXIS, effect_named(name))
    theta[: problem.n_free] += 0.01
    residual, derivative = problem.sensitivities(theta)[0]
    evaluation = problem.at(theta)
    np.testing.assert_allclose(evaluation.cost, residual @ residual, rtol=1e-9)
    size = np.linalg.norm(derivative, axis=0)
    limit = 1e-9 * np.outer(size, size)
    assert np.all(np.abs(evaluation.normal - derivative.T @ derivative) <= limit)
    assert np.all(
        np.abs(evaluation.gradient - derivative.T @ residual) <= 1e-9 * size * np.linalg.norm(residual)
    )


def test_where_functions_cost_or_friction_is_dry_derivatives_are_carried_along() -> None:
    for name in (
        "coulomb_friction",
        "stribeck_friction",
        "bouc_wen_hysteresis",
        "gravity_pendulum",
        "torque_ripple",
    ):
        assert carries_tangents(compose(AXIS, [effect_named(name)])), name
    for name in ("cubic_stiffness", "quadratic_damping", "backlash", "input_saturation", "flexible_mode"):
        assert not carries_tangents(compose(AXIS, [effect_named(name)])), name
    for others in (["coulomb_friction", "iwan_hysteresis"], ["coulomb_friction", "sensor_delay"]):
        assert not carries_tangents(compose(AXIS, map(effect_named, others)))


@pytest.mark.slow
def test_a_late_sensor_is_fitted_late_whichever_it_is() -> None:
    rig = RIGS["cart_pendulum"]
    t = DT * np.arange(N_SAMPLES)
    record = Record("sweep", DT, {"u": log_sweep(t, 0.3, 0.3, 3.0)}, {"u": "A"}, hold="band_limited")
    values = {
        "g": 9.81,
        "m_c": 0.5,
        "m_p": 0.5,
        "s": 0.6,
        "I_p": 0.5,
        "k_u": 2.0,
        "d_c": 0.4,
        "d_p": 0.1,
        "T_s": 0.02,
    }
    sensors = [sensor.name for sensor in rig.outputs]
    scales = characteristic_scales(rig, [simulate(compose(rig), values, record)], values)
    for sensor in sensors:
        structure = compose(rig, [placed(effect_named("sensor_delay"), sensor)])
        assert not carries_tangents(structure)
        fit = GreyBoxFit(
            structure, [simulate(structure, values, record)], scales, dict.fromkeys(sensors, 1e-3)
        )
        result = fit.fit({**values, "T_s": 0.01}, ["T_s"])
        assert result.success
        assert result.values["T_s"] == pytest.approx(0.02, rel=1e-4)
