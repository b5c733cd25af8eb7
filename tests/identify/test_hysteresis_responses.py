"""Predicted frequency responses against the closed form of a linear rig, and hysteresis from families of them."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named
from rigsight.errors import InputError
from rigsight.excitation import log_sweep
from rigsight.frequency import FrequencyResponse, local_polynomial_response
from rigsight.identify.hysteresis import (
    SpectralRatio,
    SteadyResponse,
    SweptResponse,
    break_frequency,
    calibrate_to_responses,
    fitted_break_frequency,
    peak,
)
from rigsight.records import Record
from rigsight.rigs import ELEMENT, RUNNING_GEAR
from rigsight.rigs.published import published_sets
from rigsight.simulate import compose, parameter_vector, simulate

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}
LATERAL = {"l_0": 0.25, "c_y": 0.98}
OMEGA = np.geomspace(1.0, 60.0, 48)
LINEAR = compose(RUNNING_GEAR)
BOUC_WEN = compose(RUNNING_GEAR, [effect_named("bouc_wen_hysteresis")], {"n": 1.0})
HYSTERETIC = {
    **published_sets()["hysteresis_r"].values(),
    "J_z": 0.58, "k_d": 0.5, "k_c": 700.0, "a": 0.09, "beta": 2660.0, "gamma": -660.0,
}  # fmt: skip


def linear_response(omega: np.ndarray = OMEGA, delay: float = 0.0) -> FrequencyResponse:
    values = 0.81 * np.exp(-1j * omega * delay) / (81.0 - 0.56 * omega**2 + 2j * omega)
    return FrequencyResponse(omega, values, "u", "psi", "rad/A")


def sweep(amplitude: float, duration: float = 30.0) -> Record:
    t = 5e-3 * np.arange(round(duration / 5e-3))
    u = log_sweep(t, amplitude, 0.5, 100.0)
    return Record(f"sweep {amplitude} A", 5e-3, {"u": u}, {"u": "A", "psi": "rad"}, kind="sweep")


def test_peak_and_break_frequency_of_a_pt2() -> None:
    natural = np.sqrt(81.0 / 0.56)
    top = peak(linear_response(np.geomspace(1.0, 60.0, 200)))
    assert top.is_resonance
    assert top.omega == pytest.approx(np.sqrt(81.0 / 0.56 - 2.0 * (1.0 / 0.56) ** 2), rel=2e-3)
    assert top.magnitude == pytest.approx(np.abs(linear_response(np.array([top.omega])).values[0]), rel=5e-3)
    assert break_frequency(linear_response()) == pytest.approx(natural, rel=1e-3)
    # A delay turns the phase and leaves the magnitude.
    late = linear_response(delay=0.02)
    assert break_frequency(late) < 0.98 * natural
    assert fitted_break_frequency(late) == pytest.approx(natural, rel=1e-6)


def test_a_band_that_does_not_show_a_feature_says_so() -> None:
    below = linear_response(np.geomspace(1.0, 5.0, 20))
    assert not peak(below).is_resonance
    with pytest.raises(InputError, match="does not pass -90 degrees"):
        break_frequency(below)


def test_steady_sines_of_a_linear_rig_give_its_transfer_function() -> None:
    values = {**published_sets()["identified"].values()}
    p = parameter_vector(LINEAR, values)[:, None]
    found = SteadyResponse(linear_response(), 0.7).predicted(LINEAR, p)[:, 0]
    # Transients that die out as exp(-5) and 48 straight pieces per cycle of the kernel's step are left.
    assert np.max(np.abs(found / linear_response().values - 1.0)) < 0.015


def test_a_slow_sweep_of_a_linear_rig_gives_its_transfer_function() -> None:
    values = {**published_sets()["identified"].values()}
    record = sweep(1.0, duration=240.0)
    found = SpectralRatio("u", "psi", OMEGA, width=0.02)(simulate(LINEAR, values, record))
    error = found.values / linear_response().values - 1.0
    assert np.sqrt(np.mean(np.abs(error) ** 2)) < 0.02


def family(rng: np.random.Generator) -> list[SweptResponse]:
    measured = []
    for amplitude in (0.25, 1.0):
        record = sweep(amplitude)
        psi = simulate(BOUC_WEN, HYSTERETIC, record)["psi"] + 2e-5 * rng.standard_normal(record.n_samples)
        response = SpectralRatio("u", "psi", OMEGA)(record.with_signals(psi=psi))
        measured.append(SweptResponse(response, record))
    return measured


def agree(values: dict[str, float], relative: float) -> None:
    for name in ("J_z", "k_c", "k_d", "a", "beta", "gamma"):
        assert values[name] == pytest.approx(HYSTERETIC[name], rel=relative), name


def test_a_family_of_swept_responses_gives_the_hysteresis_back() -> None:
    rng = np.random.default_rng(1)
    found = calibrate_to_responses(
        BOUC_WEN, family(rng), CONSTANTS, rng, start=LATERAL, n_generations=60, n_sets=64, n_ends=3
    )
    assert found.fit.success
    agree(found.values, 0.1)
    assert found.values["beta"] + found.values["gamma"] == pytest.approx(2000.0, rel=0.05)
    for name in ("J_z", "k_c", "a"):
        assert abs(found.values[name] - HYSTERETIC[name]) < 5.0 * found.standard_errors[name]
    assert len(found.derived.loop_areas) == 2


def test_a_family_of_steady_responses_gives_the_hysteresis_back() -> None:
    rng = np.random.default_rng(0)
    p = parameter_vector(BOUC_WEN, HYSTERETIC)[:, None]
    omega = OMEGA[::3]
    blank = FrequencyResponse(omega, np.ones(omega.size), "u", "psi", "rad/A")
    measured = []
    for amplitude in (0.25, 1.0):
        values = SteadyResponse(blank, amplitude).predicted(BOUC_WEN, p)[:, 0]
        scatter = 0.002 * (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size))
        response = FrequencyResponse(
            omega, values * (1.0 + scatter), "u", "psi", "rad/A", variance=8e-6 * np.abs(values) ** 2
        )
        measured.append(SteadyResponse(response, amplitude))
    found = calibrate_to_responses(
        BOUC_WEN, measured, CONSTANTS, rng, start=LATERAL, n_generations=25, n_sets=32, n_ends=2
    )
    agree(found.values, 0.1)


def test_the_estimator_of_the_measurement_is_used_for_the_model() -> None:
    """A wide local polynomial lowers the peak; the same on both sides does no harm, ignoring it does."""
    record = sweep(1.0)

    def estimator(one: Record) -> FrequencyResponse:
        return local_polynomial_response(
            one, "u", "psi", order=0, bandwidth=8.0, hold=one.hold, band=(2.0, 30.0)
        )

    values = published_sets()["identified"].values()
    measured = estimator(simulate(LINEAR, values, record))
    found = {}
    for name, chosen in (("same", estimator), ("other", None)):
        response = SweptResponse(measured, record, chosen)
        found[name] = calibrate_to_responses(
            LINEAR,
            [response],
            CONSTANTS,
            np.random.default_rng(0),
            start=LATERAL,
            n_generations=20,
            n_sets=32,
            n_ends=1,
        ).values["k_d"]
    assert found["same"] == pytest.approx(2.0, rel=0.02)
    assert abs(found["other"] / 2.0 - 1.0) > 0.1


def test_what_cannot_be_calibrated_is_explained() -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(InputError, match="at least one frequency response"):
        calibrate_to_responses(BOUC_WEN, [], CONSTANTS, rng)
    steady = SteadyResponse(linear_response(), 1.0)
    with pytest.raises(InputError, match="prescribes the motion"):
        calibrate_to_responses(compose(ELEMENT), [steady], {}, rng)
    with pytest.raises(InputError, match="amplitude"):
        calibrate_to_responses(BOUC_WEN, [SteadyResponse(linear_response(), 0.0)], CONSTANTS, rng)
    wrong = FrequencyResponse(OMEGA, np.ones(OMEGA.size), "u", "phi", "rad/A")
    with pytest.raises(InputError, match="response is 'phi'"):
        calibrate_to_responses(BOUC_WEN, [SteadyResponse(wrong, 1.0)], CONSTANTS, rng)
    beyond = FrequencyResponse(np.geomspace(1.0, 900.0, 30), np.ones(30), "u", "psi", "rad/A")
    with pytest.raises(InputError, match="Nyquist"):
        SpectralRatio("u", "psi", beyond.omega)(sweep(1.0).with_signals(psi=np.zeros(6000)))
