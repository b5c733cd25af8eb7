"""Output-error fits return the parameters that made the records, with honest standard errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.signal import lfilter

from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales, linear_start
from rigsight.records import Record
from rigsight.rigs import AXIS, RUNNING_GEAR
from rigsight.simulate import Structure, compose, parameter_vector, record_input, simulate, simulate_outputs

LINEAR = compose(AXIS)
CUBIC = compose(AXIS, [effect_named("cubic_stiffness")])
GEAR = compose(RUNNING_GEAR)
STAGE = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 1e-4, "force_off": 0.0}
GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4,
}  # fmt: skip
NOISE = 5e-5


def made(
    structure: Structure,
    values: Mapping[str, float],
    rng: np.random.Generator,
    n_samples: int = 800,
    amplitude: float = 4.0,
    initial_state: NDArray[np.float64] | None = None,
    noise: float = NOISE,
    pole: float = 0.0,
) -> Record:
    """A sweep through the resonance with stationary sensor noise of standard deviation `noise`."""
    u = linear_sweep(5e-3 * np.arange(n_samples), amplitude, 3.0, 50.0)
    record = Record(name="sweep", dt=5e-3, signals={"u": u}, units={})
    clean = simulate(structure, values, record, initial_state)
    outputs = {}
    for signal in structure.rig.outputs:
        white = np.sqrt(1.0 - pole**2) * rng.standard_normal(n_samples + 300)
        outputs[signal.name] = clean[signal.name] + noise * lfilter([1.0], [1.0, -pole], white)[300:]
    return clean.with_signals(**outputs)


def fitted(
    structure: Structure,
    records: Sequence[Record],
    truth: Mapping[str, float],
    free: Sequence[str],
    start: Mapping[str, float] | None = None,
    **settings: float,
) -> FitResult:
    scales = characteristic_scales(structure.rig, records, truth)
    noise = dict.fromkeys((s.name for s in structure.rig.outputs), NOISE)
    return GreyBoxFit(structure, records, scales, noise, **settings).fit(start or truth, free)


def test_a_cubic_axis_returns_its_parameters_from_noisy_records_in_motion() -> None:
    rng = np.random.default_rng(1)
    truth = {**STAGE, "k_3": 5e6}
    first_states = (np.array([4e-3, 0.1]), np.array([-2e-3, -0.15]))
    records = [made(CUBIC, truth, rng, 1500, initial_state=state) for state in first_states]
    free = ("m", "d", "k", "x_off", "k_3")
    linear = fitted(
        LINEAR, records, truth, free[:4], {**STAGE, **linear_start(AXIS, records, {"gain": 1.0}, {})}
    )
    assert linear.weighted_rms > 5.0
    result = fitted(CUBIC, records, truth, free, {**linear.values, "k_3": 0.0})
    assert result.success, result.message
    for name in free:
        assert abs(result.values[name] - truth[name]) < 4.0 * result.standard_errors[name], name
    # A spring that is not seen would pass any test of errors: the cubic term is known to a percent.
    assert result.standard_errors["k_3"] < 0.01 * truth["k_3"]
    assert result.weighted_rms == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * result.n_samples))
    # No worse than a single sample tells the position, and omega = 20 rad/s times that the velocity.
    for found, state in zip(result.initial_states, first_states, strict=True):
        assert np.all(np.abs(found - state) < 4.0 * NOISE * np.array([1.0, 20.0]))


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_standard_errors_are_the_scatter_of_repeated_experiments(pole: float) -> None:
    free = ("m", "d", "k", "x_off")
    rng = np.random.default_rng(2)
    pulls = []
    for _ in range(30):
        result = fitted(LINEAR, [made(LINEAR, STAGE, rng, pole=pole)], STAGE, free)
        assert result.success, result.message
        pulls.append([(result.values[n] - STAGE[n]) / result.standard_errors[n] for n in free])
    scatter = np.std(np.array(pulls), axis=0, ddof=1)
    # The standard deviation of 30 draws scatters by 1/sqrt(58) = 13 %; four parameters, three sigma.
    assert np.all(np.abs(scatter - 1.0) < 3.0 / np.sqrt(58.0)), dict(zip(free, scatter, strict=True))
    assert np.all(np.abs(np.mean(pulls, axis=0)) < 3.0 / np.sqrt(30.0))


def test_the_compressed_problem_has_the_solution_of_plain_least_squares() -> None:
    record = made(LINEAR, STAGE, np.random.default_rng(3), 400)
    free = ("m", "d", "k")
    result = fitted(LINEAR, [record], STAGE, free, {**STAGE, "m": 1.8, "k": 850.0}, accuracy=1e-6)
    held = record_input(LINEAR, record)

    def residuals(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        p = parameter_vector(LINEAR, {**STAGE, **dict(zip(free, theta[:3] * start[:3], strict=True))})
        out = simulate_outputs(LINEAR, held, p, theta[3:] * start[3:], record.n_samples, 1e-9)
        return np.asarray((record["x"] - out[:, 0]) / NOISE)

    start = np.array([2.0, 5.0, 800.0, 1e-3, 1e-2])
    plain = least_squares(
        residuals, np.array([1.0, 1.0, 1.0, 0.0, 0.0]), diff_step=1e-6, xtol=1e-12, ftol=1e-12
    )
    assert result.cost == pytest.approx(2.0 * plain.cost, rel=1e-6)
    for name, value in zip(free, plain.x[:3] * start[:3], strict=True):
        assert abs(result.values[name] - value) < 0.02 * result.standard_errors[name], name


def test_a_record_without_the_second_output_still_counts_for_the_first() -> None:
    rng = np.random.default_rng(4)
    full, other = (made(GEAR, GEAR_VALUES, rng, 800, amplitude=1.0) for _ in range(2))
    yaw = Record(name="yaw", dt=other.dt, signals={n: other[n] for n in ("u", "psi")}, units={})
    free = ("J_z", "k_c", "k_d", "psi_off", "l_0", "c_y", "y_off")
    both, alone = (fitted(GEAR, records, GEAR_VALUES, free) for records in ([full, yaw], [full]))
    assert both.n_samples == 3 * 800
    assert np.all(np.isnan(both.residuals[1][:, 1]))
    assert np.all(np.isfinite(both.residuals[1][:, 0]))
    for name in free:
        assert abs(both.values[name] - GEAR_VALUES[name]) < 4.0 * both.standard_errors[name], name
    # Twice the yaw data: errors of the yaw part fall by about the root of two.
    for name in ("J_z", "k_c", "k_d"):
        ratio = both.standard_errors[name] / alone.standard_errors[name]
        assert 0.55 < ratio < 0.9, name


def test_no_record_with_the_second_output_says_nothing_about_it() -> None:
    other = made(GEAR, GEAR_VALUES, np.random.default_rng(5), 800, amplitude=1.0)
    yaw = Record(name="yaw", dt=other.dt, signals={n: other[n] for n in ("u", "psi")}, units={})
    result = fitted(GEAR, [yaw], GEAR_VALUES, ("J_z", "k_c", "k_d", "l_0", "c_y"))
    assert result.standard_errors["l_0"] == np.inf
    assert result.standard_errors["c_y"] == np.inf
    assert result.standard_errors["k_c"] < 0.01 * GEAR_VALUES["k_c"]


def test_a_start_that_cannot_be_simulated_is_a_result_not_an_exception() -> None:
    record = made(LINEAR, STAGE, np.random.default_rng(6), 400)
    start = {**STAGE, "k_3": -1e15}
    result = fitted(CUBIC, [record], {**STAGE, "k_3": 0.0}, ("m", "d", "k"), start)
    assert not result.success
    assert "cannot be simulated" in result.message
    assert result.cost == np.inf
    assert all(error == np.inf for error in result.standard_errors.values())


def test_running_out_of_evaluations_is_no_success() -> None:
    record = made(LINEAR, STAGE, np.random.default_rng(7), 400)
    scales = characteristic_scales(AXIS, [record], STAGE)
    fit = GreyBoxFit(LINEAR, [record], scales, {"x": NOISE})
    result = fit.fit({**STAGE, "m": 1.0, "k": 500.0}, ("m", "d", "k"), max_evaluations=2)
    assert not result.success
    assert result.message


def test_without_free_parameters_only_the_initial_state_is_fitted() -> None:
    first_state = np.array([4e-3, 0.1])
    record = made(LINEAR, STAGE, np.random.default_rng(8), initial_state=first_state)
    result = fitted(LINEAR, [record], STAGE, ())
    assert result.success
    assert result.values == STAGE
    assert (result.free, result.standard_errors, result.covariance.shape) == ((), {}, (0, 0))
    assert np.all(np.abs(result.initial_states[0] - first_state) < 4.0 * NOISE * np.array([1.0, 20.0]))
    assert result.weighted_rms == pytest.approx(1.0, abs=4.0 / np.sqrt(2.0 * result.n_samples))


def test_a_parameter_that_moves_nothing_has_an_infinite_error_and_spoils_no_other() -> None:
    """Without a spring the rest position means nothing."""
    truth = {**STAGE, "k": 0.0, "x_off": 0.0}
    record = made(LINEAR, truth, np.random.default_rng(9), 400)
    useless, needed = (fitted(LINEAR, [record], truth, free) for free in (("m", "d", "x_off"), ("m", "d")))
    assert useless.standard_errors["x_off"] == np.inf
    for name in ("m", "d"):
        assert useless.standard_errors[name] == pytest.approx(needed.standard_errors[name], rel=1e-3)


def test_two_parameters_that_do_the_same_have_no_useful_errors() -> None:
    """A linear spring cannot tell a constant force from a shifted rest position."""
    record = made(LINEAR, STAGE, np.random.default_rng(10))
    tied = fitted(LINEAR, [record], STAGE, ("m", "d", "k", "x_off", "force_off"))
    alone = fitted(LINEAR, [record], STAGE, ("m", "d", "k", "x_off"))
    assert tied.standard_errors["x_off"] > 30.0 * alone.standard_errors["x_off"]
    assert tied.standard_errors["force_off"] > 30.0 * STAGE["k"] * alone.standard_errors["x_off"]
    assert tied.standard_errors["m"] == pytest.approx(alone.standard_errors["m"], rel=0.01)


def test_a_fit_from_the_linear_start_needs_few_evaluations() -> None:
    record = made(LINEAR, STAGE, np.random.default_rng(11))
    start = {**STAGE, **linear_start(AXIS, [record], {"gain": 1.0}, {})}
    result = fitted(LINEAR, [record], STAGE, ("m", "d", "k", "x_off"), start)
    assert result.success
    assert result.n_evaluations <= 15
