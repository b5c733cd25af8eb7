"""Errors of frequency responses against values computed by hand, and the estimator against a closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rigsight.compare import Floor, response_error, response_floor, signal_paths
from rigsight.compare.response_error import measured_responses, simulated_response
from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.frequency import FrequencyResponse
from rigsight.records import Record
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR
from rigsight.simulate import compose, simulate

LINEAR = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
LIGHT = {**LINEAR, "m": 1.0, "d": 1.5, "k": 400.0}


def response(
    omega: list[float], values: list[complex], variance: list[float] | None = None
) -> FrequencyResponse:
    return FrequencyResponse(
        np.array(omega), np.array(values, dtype=complex), "u", "psi", "rad/A",
        variance=None if variance is None else np.array(variance),
    )  # fmt: skip


def test_the_errors_are_those_of_the_definition() -> None:
    """(5.1): magnitudes differ by 1 and 0, phases by 0 and 90 degrees, the ratio is 2 and 1."""
    error = response_error(response([1.0, 2.0], [1.0, 2.0j]), response([1.0, 2.0], [2.0, -2.0]))
    assert error.magnitude == pytest.approx(1.0 / math.sqrt(2.0))
    assert error.phase == pytest.approx(math.pi / 2.0 / math.sqrt(2.0))
    assert error.decibel == pytest.approx(20.0 * math.log10(2.0) / math.sqrt(2.0))
    assert error.n_lines == 2


def test_a_phase_differs_by_the_shorter_way_round() -> None:
    before, behind = (np.exp(1j * math.radians(angle)) for angle in (179.0, -179.0))
    assert response_error(response([1.0], [before]), response([1.0], [behind])).phase == pytest.approx(
        math.radians(2.0)
    )


def test_rescaled_phases_of_the_thesis_are_compared_unwrapped() -> None:
    omega = np.linspace(1.0, 10.0, 40)
    falls = np.exp(-1j * np.linspace(0.0, 3.0, 40))
    turns = np.exp(-1j * np.linspace(0.0, 6.5, 40))
    thesis, other = (
        replace(response(list(omega), list(values)), method="thesis: FFT ratio") for values in (falls, turns)
    )
    expected = math.sqrt(np.mean(np.linspace(0.0, 3.5, 40) ** 2))
    assert response_error(thesis, other).phase == pytest.approx(expected)


def test_only_lines_that_both_have_are_compared() -> None:
    error = response_error(
        response([1.0, 2.0, 3.0], [1.0, 1.0, 9.0]), response([2.0, 1.0 + 1e-9 + 2.0], [1.5, 9.0])
    )
    assert error.n_lines == 2
    assert error.magnitude == pytest.approx(0.5 / math.sqrt(2.0))
    with pytest.raises(InputError, match="in common"):
        response_error(response([1.0], [1.0]), response([2.0], [1.0]))


@pytest.mark.parametrize("seconds", [20.0, 80.0])
def test_the_floor_is_the_error_of_the_true_model_however_nonlinear_the_rig_is(seconds: float) -> None:
    dt = 4e-3
    t = dt * np.arange(round(seconds / dt))
    friction = effect_named("coulomb_friction")
    bare = Record("sweep", dt, {"u": log_sweep(t, 3.0, 3.0, 90.0)}, {"u": "N", "x": "m"}, kind="sweep")
    clean = simulate(compose(AXIS, [friction]), {**LIGHT, "T_c": 0.6}, bare)
    floor = Floor("x", "m", 0.01 * float(np.std(clean["x"])), "known")
    rng = np.random.default_rng(1)
    noisy = clean.with_signals(x=clean["x"] + floor.noise(t.size, dt, rng))
    noisier = [noisy.with_signals(x=noisy["x"] + floor.noise(t.size, dt, rng)) for _ in range(4)]
    (path,) = signal_paths(AXIS)
    measured = measured_responses(noisy, (path,), "local_rational")[0][path.name]
    error = response_error(measured, simulated_response(clean, path, "local_rational", measured))
    least = response_floor(noisier, path, "local_rational", measured)
    assert least is not None
    assert measured.variance is not None
    assert error.magnitude == pytest.approx(least.magnitude, rel=0.3)
    assert error.decibel == pytest.approx(least.decibel, rel=0.3)
    # The variance of the estimate holds the distortion as well.
    assert np.sqrt(np.mean(measured.variance) / 2.0) > 3.0 * error.magnitude


def test_lines_beyond_the_sweep_are_not_compared_however_fast_the_record_was_sampled() -> None:
    dt = 1e-3
    t = dt * np.arange(5000)
    bare = Record("sweep", dt, {"u": log_sweep(t, 3.0, 3.0, 90.0)}, {"u": "N", "x": "m"}, kind="sweep")
    clean = simulate(compose(AXIS), LIGHT, bare)
    noise = np.random.default_rng(1).normal(scale=0.01 * np.std(clean["x"]), size=t.size)
    (path,) = signal_paths(AXIS)
    found, problems = measured_responses(clean.with_signals(x=clean["x"] + noise), (path,), "local_rational")
    assert not problems
    assert found[path.name].omega[-1] < 150.0
    found, (problem,) = measured_responses(clean.with_signals(x=noise), (path,), "local_rational")
    assert not found
    assert "too few for a comparison" in problem


def test_the_paths_of_a_running_gear_are_cut_where_the_thesis_cuts_them() -> None:
    yaw, lateral = signal_paths(RUNNING_GEAR)
    assert (yaw.name, yaw.upper_cut, yaw.is_commanded) == ("u -> psi", 80.0, True)
    assert (lateral.name, lateral.upper_cut, lateral.is_commanded) == ("psi -> y", 30.0, False)
    (stage,) = signal_paths(AXIS)
    assert (stage.name, stage.upper_cut) == ("u -> x", math.inf)
    (element,) = signal_paths(ELEMENT)
    assert (element.name, element.is_commanded) == ("x -> force", False)


def test_a_simulation_is_read_by_the_estimator_of_the_measurement_and_shows_the_closed_form() -> None:
    t = 5e-3 * np.arange(6000)
    u = np.concatenate([np.zeros(400), log_sweep(t[800:], 1.0, 2.0, 90.0), np.zeros(400)])
    bare = Record("sweep", 5e-3, {"u": u}, {"u": "N", "x": "m"}, kind="sweep")
    clean = simulate(compose(AXIS), LINEAR, bare)
    noisy = clean.with_signals(x=clean["x"] + np.random.default_rng(1).normal(scale=1e-6, size=u.size))
    (path,) = signal_paths(AXIS)
    measured, problems = measured_responses(noisy, (path,), "local_rational")
    assert not problems
    own = simulated_response(clean, path, "local_rational", measured[path.name])
    truth = 1.0 / (LINEAR["k"] - LINEAR["m"] * own.omega**2 + 1j * LINEAR["d"] * own.omega)
    np.testing.assert_allclose(own.values, truth, rtol=2e-3)
    assert response_error(measured[path.name], own).n_lines == measured[path.name].omega.size


def test_a_step_has_no_frequency_response_and_says_nothing() -> None:
    record = Record("step", 5e-3, {"u": np.ones(100), "x": np.ones(100)}, {}, kind="step")
    assert measured_responses(record, signal_paths(AXIS), "local_rational") == ({}, [])


def test_a_silent_sweep_is_told() -> None:
    record = Record("sweep", 5e-3, {"u": np.ones(500), "x": np.ones(500)}, {}, kind="sweep")
    found, (problem,) = measured_responses(record, signal_paths(AXIS), "local_rational")
    assert not found
    assert "u -> x" in problem
