"""PT1 and PT2 come back from frequency responses, with standard errors that are the scatter."""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np
import pytest
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.frequency import FrequencyResponse, local_polynomial_response, local_rational_response
from rigsight.identify import TransferFit, TransferForm, fit_frequency_response
from rigsight.records import Record

from ...experiments.studies import of_study

over_time = of_study("thesis", "form_over_time").over_time
PT2 = TransferForm("pt2", with_dead_time=True)
PT1 = TransferForm("pt1", with_dead_time=True)
OMEGA = np.geomspace(0.5, 80.0, 120)
YAW = {"gain": 0.01, "omega_b": 12.0, "zeta": 0.15}
GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4,
}  # fmt: skip


def measured(
    values: dict[str, float],
    relative_noise: float = 0.03,
    seed: int = 0,
    omega: NDArray[np.float64] = OMEGA,
    with_variance: bool = True,
) -> FrequencyResponse:
    """A frequency response with circular normal errors, `relative_noise` of its median magnitude."""
    form = PT2 if "zeta" in values else PT1
    theta = form.vector(values["omega_b"], values.get("zeta", 1.0), values.get("dead_time", 0.0))
    theta[0] = values["gain"]
    exact = form.response(omega, theta)
    std = relative_noise * np.median(np.abs(exact)) * (1.0 + omega / omega[-1])
    parts = np.random.default_rng(seed).standard_normal((2, omega.size))
    noise = (parts[0] + 1j * parts[1]) / np.sqrt(2.0)
    return FrequencyResponse(
        omega, exact + std * noise, "u", "psi", "rad/A", variance=std**2 if with_variance else None
    )


def pulls(fit: TransferFit, truth: dict[str, float]) -> list[float]:
    return [(fit.values[name] - truth[name]) / fit.standard_errors[name] for name in truth]


@pytest.mark.parametrize(
    "truth",
    [
        YAW,
        {**YAW, "zeta": 0.005},
        {**YAW, "zeta": 1.6},
        {**YAW, "gain": -0.01, "dead_time": 0.04},
        {"gain": 0.5, "omega_b": 2.0},
        {"gain": 0.5, "omega_b": 2.0, "dead_time": 0.3},
    ],
)
@pytest.mark.parametrize("with_variance", [True, False])
def test_a_known_system_comes_back_within_its_errors(truth: dict[str, float], with_variance: bool) -> None:
    frequency_response = measured(truth, with_variance=with_variance)
    order = "pt2" if "zeta" in truth else "pt1"
    fit = fit_frequency_response(frequency_response, order, 0.5 if "dead_time" in truth else 0.0)
    assert fit.success, fit.message
    assert np.all(np.abs(pulls(fit, truth)) < 4.0)
    if with_variance:
        assert fit.misfit == pytest.approx(1.0, abs=4.0 / np.sqrt(4.0 * OMEGA.size))


@pytest.mark.slow
def test_intervals_contain_the_truth_as_often_as_they_say() -> None:
    truth = {**YAW, "dead_time": 0.02}
    found = np.array(
        [pulls(fit_frequency_response(measured(truth, seed=i), "pt2", 0.1), truth) for i in range(100)]
    )
    inside = np.mean(np.abs(found) < 1.96, axis=0)
    # 100 draws of a 95 % interval: a standard deviation of 2.2 %, four parameters.
    assert np.all(inside > 0.95 - 3.0 * 0.022), inside
    assert np.all(np.abs(np.std(found, axis=0, ddof=1) - 1.0) < 3.0 / np.sqrt(198.0))


@pytest.mark.slow
def test_maximum_likelihood_beats_uniform_weights_where_noise_differs() -> None:
    std = np.where(OMEGA < 10.0, 1e-5, 5e-4)
    exact = measured(YAW, 0.0).values
    errors: dict[str, list[float]] = {"variance": [], "uniform": []}
    for seed in range(20):
        parts = np.random.default_rng(seed).standard_normal((2, OMEGA.size))
        values = exact + std * (parts[0] + 1j * parts[1]) / np.sqrt(2.0)
        response = FrequencyResponse(OMEGA, values, "u", "psi", "rad/A", variance=std**2)
        for weighting, collected in errors.items():
            fit = fit_frequency_response(response, "pt2", weighting=weighting)
            collected.append(fit.values["omega_b"] - YAW["omega_b"])
    assert np.std(errors["variance"]) < 0.3 * np.std(errors["uniform"])


@pytest.mark.slow
@pytest.mark.parametrize("method", [local_polynomial_response, local_rational_response])
def test_errors_from_a_local_model_are_the_scatter_of_repeated_records(method) -> None:  # type: ignore[no-untyped-def]
    """Its lines overlap: counted as independent they would promise errors two to three times too small."""
    t = 5e-3 * np.arange(12_000)
    u = np.zeros(t.size)
    u[1000:10_000] = linear_sweep(t[:9000], 1.0, 1.0, 40.0)
    theta = PT2.vector(12.0, 0.3, 0.0)
    theta[0] = 1.0
    clean = over_time(PT2, u, 5e-3, "foh", theta)
    rng = np.random.default_rng(4)
    values, errors, naive = [], [], []
    for _ in range(60):
        psi = clean + 0.02 * rng.standard_normal(t.size)
        record = Record("sweep", 5e-3, {"u": u, "psi": psi}, {"u": "A", "psi": "rad"}, hold="foh")
        response = method(record, "u", "psi", hold="foh", band=(3.0, 30.0))
        fit = fit_frequency_response(response, "pt2")
        alone = fit_frequency_response(replace(response, noise_shares=None, noise_lines=None), "pt2")
        values.append([fit.values[name] for name in fit.names])
        errors.append([fit.standard_errors[name] for name in fit.names])
        naive.append([alone.standard_errors[name] for name in fit.names])
    scatter = np.std(values, axis=0)
    # Sixty draws know a scatter to 9 %.
    np.testing.assert_allclose(np.mean(errors, axis=0) / scatter, 1.0, atol=0.27)
    assert np.all(np.mean(naive, axis=0) < 0.7 * scatter)


def test_a_lag_has_a_negative_phase_and_a_dead_time_bends_it_further() -> None:
    late = fit_frequency_response(measured({**YAW, "dead_time": 0.05}, 1e-3), "pt2", 0.2)
    phase = np.unwrap(np.angle(late.at(OMEGA)))
    assert phase[0] < 0.0
    assert phase[-1] == pytest.approx(-np.pi - 0.05 * OMEGA[-1], abs=0.1)
    assert late.values["gain"] > 0.0


def test_magnitudes_see_neither_sign_nor_dead_time() -> None:
    straight = measured(YAW, 0.01)
    turned = FrequencyResponse(
        OMEGA, -straight.values * np.exp(-0.05j * OMEGA), "u", "psi", "rad/A", variance=straight.variance
    )
    first, second = (fit_frequency_response(r, "pt2", magnitude_only=True) for r in (straight, turned))
    assert second.values == pytest.approx(first.values, rel=1e-6)
    assert first.values["gain"] > 0.0
    assert "sign" in second.message
    assert np.all(np.abs(pulls(first, YAW)) < 4.0)
    assert fit_frequency_response(turned, "pt2", 0.1).values["gain"] < 0.0
    with pytest.raises(InputError, match="phase only"):
        fit_frequency_response(straight, "pt2", 0.1, magnitude_only=True)


def test_the_fit_is_a_python_control_transfer_function() -> None:
    fit = fit_frequency_response(measured({**YAW, "dead_time": 0.03}, 0.0), "pt2", 0.1)
    rational = fit.to_control()
    assert control.dcgain(rational) == pytest.approx(YAW["gain"], rel=1e-6)
    assert np.abs(rational(1j * 12.0)) == pytest.approx(YAW["gain"] / (2.0 * YAW["zeta"]), rel=1e-6)
    omega = np.array([1.0, 10.0, 30.0])
    assert fit.to_control(pade_order=4)(1j * omega) == pytest.approx(fit.at(omega), rel=1e-5)
    with pytest.raises(InputError, match="at least 1"):
        fit.to_control(pade_order=0)


@pytest.mark.slow
def test_the_error_band_is_the_scatter_of_the_fitted_response() -> None:
    omega = np.array([1.0, 11.0, 13.0, 40.0])
    fits = [fit_frequency_response(measured(YAW, seed=i), "pt2") for i in range(60)]
    scatter = np.sqrt(
        np.mean(np.abs([f.at(omega) - measured(YAW, 0.0, omega=omega).values for f in fits]) ** 2, 0)
    )
    assert fits[0].standard_error_at(omega) == pytest.approx(scatter, rel=0.35)


def test_bad_frequency_responses_are_told_in_words() -> None:
    with pytest.raises(InputError, match="too few for 3 parameters"):
        fit_frequency_response(measured(YAW, omega=np.array([1.0, 5.0, 10.0])), "pt2")
    with pytest.raises(InputError, match="no excitation in this band"):
        fit_frequency_response(measured(YAW, 300.0), "pt2")
    with pytest.raises(InputError, match="needs variances"):
        fit_frequency_response(measured(YAW, with_variance=False), "pt2", weighting="variance")
    with pytest.raises(InputError, match="at least 0 s"):
        fit_frequency_response(measured(YAW), "pt2", -1.0)
    with pytest.raises(InputError, match="pt1"):
        fit_frequency_response(measured(YAW), "pt3")  # type: ignore[arg-type]


def test_a_band_below_the_break_frequency_is_no_success() -> None:
    low = fit_frequency_response(measured(YAW, omega=np.linspace(0.05, 0.6, 50)), "pt2")
    assert not low.success
    assert "does not show the break frequency" in low.message


@pytest.mark.slow
def test_the_wrong_form_is_named_by_its_misfit() -> None:
    fit = fit_frequency_response(measured(YAW, 0.01), "pt1")
    assert fit.misfit > 3.0
    assert "the model order is too low" in fit.message


@pytest.mark.parametrize("dead_time", [0.0, 0.0125, 0.02])
@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_sampled_response_is_that_of_samples_over_time(hold: str, dead_time: float) -> None:
    """The response to a pulse that has died out within the record, held on steps or straight lines."""
    dt, n = 5e-3, 4000
    t = dt * np.arange(n)
    theta = PT1.vector(3.0, 1.0, dead_time)

    def after(time: np.ndarray) -> np.ndarray:
        """Response to a unit step, or to a unit ramp, at time zero."""
        since = np.maximum(time - dead_time, 0.0)
        moved = 1.0 - np.exp(-3.0 * since)
        return moved if hold == "zoh" else since - moved / 3.0

    # A pulse on straight lines begins a sample before it.
    ahead, now, behind = after(t + dt), after(t), after(t - dt)
    answer = now - behind if hold == "zoh" else (ahead - 2.0 * now + behind) / dt
    lines = np.fft.rfft(answer)[1:400]
    found = PT1.sampled_response(2.0 * np.pi * np.arange(1, 400) / (n * dt), dt, hold, theta)  # type: ignore[arg-type]
    assert found == pytest.approx(lines, abs=1e-9)
