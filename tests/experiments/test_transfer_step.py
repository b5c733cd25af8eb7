"""PT1 and PT2 come back from steps, with standard errors that are the scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rigsight.errors import InputError
from rigsight.excitation import step
from rigsight.identify import TransferFit, TransferForm
from rigsight.records import Record
from rigsight.rigs import RUNNING_GEAR
from rigsight.simulate import compose, simulate

from .studies import of_study

over_time = of_study("thesis", "form_over_time").over_time
fit_step = of_study("thesis", "transfer_step").fit_step
PT1 = TransferForm("pt1", with_dead_time=True)
GEAR_VALUES = {
    "v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27,
    "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "psi_off": 1e-3, "l_0": 0.25, "c_y": 0.98, "y_off": -5e-4,
}  # fmt: skip


def pulls(fit: TransferFit, truth: dict[str, float]) -> list[float]:
    return [(fit.values[name] - truth[name]) / fit.standard_errors[name] for name in truth]


def stepped(seed: int, noise: float = 2e-5, color: float = 0.0) -> Record:
    """The thesis's step: 0.6 A at 180 s."""
    t = 176.0 + 5e-3 * np.arange(1800)
    record = Record(
        name="step",
        dt=5e-3,
        signals={"u": step(t, 0.6, 180.0)},
        units={"u": "A", "psi": "rad"},
        t0=176.0,
        hold="zoh",
    )
    clean = simulate(compose(RUNNING_GEAR), GEAR_VALUES, record)
    white = np.random.default_rng(seed).standard_normal(t.size)
    for i in range(1, t.size):
        white[i] = color * white[i - 1] + np.sqrt(1.0 - color**2) * white[i]
    return clean.with_signals(psi=clean["psi"] + noise * white)


STEP_TRUTH = {
    "gain": 0.01,
    "omega_b": float(np.sqrt(81.0 / 0.56)),
    "zeta": float(1.0 / np.sqrt(81.0 * 0.56)),
    "offset": 1e-3,
}


@pytest.mark.parametrize("start", [None, 178.0, 180.0])
def test_a_step_gives_the_pt2_from_any_window_at_rest(start: float | None) -> None:
    fit = fit_step(stepped(1), "u", "psi", "pt2", start, 184.0)
    assert fit.success, fit.message
    assert fit.unit == "rad/A"
    assert np.all(np.abs(pulls(fit, STEP_TRUTH)) < 4.0)
    assert np.sqrt(np.mean(fit.residuals**2)) == pytest.approx(2e-5, rel=0.1)


@pytest.mark.parametrize("color", [0.0, 0.8])
def test_errors_from_steps_are_the_scatter_also_with_colored_noise(color: float) -> None:
    found = np.array(
        [
            pulls(fit_step(stepped(i, 5e-5, color), "u", "psi", "pt2", 178.0, 183.0), STEP_TRUTH)
            for i in range(12)
        ]
    )
    # 48 pulls of unit variance, not all independent: three standard deviations of an rms of 24.
    assert np.sqrt(np.mean(found**2)) == pytest.approx(1.0, abs=3.0 / np.sqrt(48.0))


def test_a_dead_time_is_found_in_a_step() -> None:
    record = stepped(3)
    late = record.with_signals(psi=np.concatenate([np.full(7, record["psi"][0]), record["psi"][:-7]]))
    fit = fit_step(late, "u", "psi", "pt2", 179.0, 184.0, longest_dead_time=0.2)
    assert abs(fit.values["dead_time"] - 0.035) < 4.0 * fit.standard_errors["dead_time"]
    assert fit.standard_errors["dead_time"] < 2e-3


def test_the_unit_of_a_step_response_divides_by_the_whole_unit_of_its_source() -> None:
    driven = replace(stepped(1), units={"u": "N m", "psi": "rad"})
    assert fit_step(driven, "u", "psi", "pt2", 178.0, 184.0).unit == "rad/(N m)"


def test_bad_steps_are_told_in_words() -> None:
    record = stepped(4)
    with pytest.raises(InputError, match="has no step"):
        fit_step(record, "u", "psi", "pt2", 181.0, 184.0)
    noisy = record.with_signals(u=1e-3 * np.random.default_rng(5).standard_normal(record.n_samples))
    with pytest.raises(InputError, match="has no step"):
        fit_step(noisy, "u", "psi", "pt2")
    with pytest.raises(InputError, match="samples before the end"):
        fit_step(record, "u", "psi", "pt2", 178.0, 180.05)
    with pytest.raises(InputError, match="the window holds"):
        fit_step(record, "u", "psi", "pt2", 200.0, 210.0)
    deaf = record.with_signals(psi=2e-5 * np.random.default_rng(6).standard_normal(record.n_samples))
    fit = fit_step(deaf, "u", "psi", "pt2", 178.0, 184.0)
    assert not fit.success
    assert "does not exceed the noise" in fit.message


@pytest.mark.slow
def test_errors_from_short_steps_allow_for_a_disturbance_that_rings_as_the_rig_does() -> None:
    """Lightly damped, 4 s, and nearly all that is left is a disturbance: lines of a spectrum lie wider than the resonance."""
    own = {**GEAR_VALUES, "k_d": 1.2}
    truth = {**STEP_TRUTH, "zeta": 1.2 / (2.0 * np.sqrt(81.0 * 0.56))}
    found = []
    for seed in range(16):
        rng = np.random.default_rng([8, seed])
        t = 5e-3 * np.arange(8800)
        pole = np.exp(-5.0 * 5e-3)
        unseen = 2e-2 * np.sqrt(1.0 - pole**2) * lfilter([1.0], [1.0, -pole], rng.standard_normal(t.size))
        u = step(t, 0.6, 40.0)
        record = Record("step", 5e-3, {"u": u + unseen}, {"u": "A", "psi": "rad"}, hold="zoh")
        clean = simulate(compose(RUNNING_GEAR), own, record)
        seen = record.with_signals(u=u, psi=clean["psi"] + rng.normal(0.0, 2e-5, t.size))
        found.append(pulls(fit_step(seen, "u", "psi", "pt2", 40.0, 44.0), truth))
    # 16 pulls of each of four parameters: three standard deviations of their rms.
    assert np.sqrt(np.mean(np.square(found), axis=0)) == pytest.approx(1.0, abs=3.0 / np.sqrt(32.0))


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_the_answer_over_time_is_the_one_of_the_simulator(hold: str) -> None:
    """Another code, another method: generated Runge-Kutta kernel against matrix exponentials."""
    t = 5e-3 * np.arange(600)
    u = step(t, 0.6, 0.5) + np.where(t > 1.0, 0.3 * np.sin(9.0 * (t - 1.0)), 0.0)
    record = Record(name="r", dt=5e-3, signals={"u": u}, units={}, hold=hold)  # type: ignore[arg-type]
    values = {**GEAR_VALUES, "psi_off": 0.0, "y_off": 0.0}
    simulated = simulate(compose(RUNNING_GEAR), values, record, accuracy=1e-8)
    theta = TransferForm("pt2").vector(np.sqrt(81.0 / 0.56), 2.0 / (2.0 * np.sqrt(81.0 * 0.56)), 0.0)
    theta[0] = 0.81 / 81.0
    answer = over_time(TransferForm("pt2"), u, 5e-3, hold, theta)  # type: ignore[arg-type]
    assert answer == pytest.approx(simulated["psi"], abs=1e-6 * np.max(np.abs(answer)))


@pytest.mark.parametrize("dead_time", [0.0125, 0.02])
def test_a_dead_time_shifts_the_answer_also_between_samples(dead_time: float) -> None:
    t = 5e-3 * np.arange(400)
    theta = PT1.vector(3.0, 1.0, dead_time)
    answer = over_time(PT1, step(t, 1.0, 0.1), 5e-3, "zoh", theta)
    since = np.maximum(t - 0.1 - dead_time, 0.0)
    assert answer == pytest.approx(1.0 - np.exp(-3.0 * since), abs=1e-9)
