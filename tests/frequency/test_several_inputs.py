"""Responses to several inputs, against two masses whose sampled motion is known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import cont2discrete, dlsim

from rigsight.errors import InputError
from rigsight.frequency import responses_of_inputs
from rigsight.records.record import Kind, Record

Floats = NDArray[np.float64]
DT, N, NOISE = 0.01, 4000, 1e-4
T = DT * np.arange(N)
MASS, DAMPING = np.diag([1.0, 2.0]), np.array([[1.0, -0.5], [-0.5, 1.0]])
STIFFNESS = np.array([[300.0, -200.0], [-200.0, 250.0]])
A = np.block(
    [[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, DAMPING)]]
)
B, C = np.vstack([np.zeros((2, 2)), np.linalg.inv(MASS)]), np.eye(2, 4)
INPUTS, OUTPUTS = ("left", "right"), ("x", "z")


def truth(omega: Floats, source: str, response: str) -> NDArray[np.complex128]:
    at = [C @ np.linalg.solve(1j * w * np.eye(4) - A, B) for w in omega]
    return np.array(at)[:, OUTPUTS.index(response), INPUTS.index(source)]


def test_more_excitation_is_advised_only_where_noise_hides_the_response() -> None:
    rng = np.random.default_rng(4)
    drive = rng.standard_normal(N)
    turning = np.cumsum(np.cumsum(drive)) * 10.0
    wrapped, still = (turning + np.pi) % (2.0 * np.pi) - np.pi, rng.standard_normal(N)
    reported = {}
    for name, reading in (("wrapped", np.convolve(wrapped, np.ones(9) / 9.0, "same")), ("still", still)):
        record = Record(name, DT, {"left": drive, "x": reading}, {}, kind="multisine")
        reported[name] = responses_of_inputs([record], ["left"], ["x"]).problems["left", "x"]
    assert "more strongly" in reported["still"]
    assert "more strongly" not in reported["wrapped"]


def recorded(
    left: Floats, right: Floats, rng: np.random.Generator, dt: float = DT, kind: Kind = "multisine"
) -> Record:
    """Return a record of both masses that starts from rest, with white noise on both sensors."""
    u = np.column_stack([left, right])
    _, y, _ = dlsim(cont2discrete((A, B, C, np.zeros((2, 2))), dt, "foh"), u)
    y = y + NOISE * rng.standard_normal(y.shape)
    signals = {"left": left, "right": right, "x": y[:, 0], "z": y[:, 1]}
    return Record(
        f"r{rng.integers(1_000_000)}", dt, signals, {"x": "m", "z": "m", "left": "N", "right": "N"}, kind=kind
    )


def multisine(rng: np.random.Generator, n: int = N, periods: int = 1, dt: float = DT) -> Floats:
    n_period = n // periods
    line = np.arange(n_period // 2 + 1)
    omega = 2.0 * np.pi * line / (n_period * dt)
    driven = (omega > 1.0) & (omega < 40.0)
    lines = np.where(driven, np.exp(2j * np.pi * rng.random(line.size)), 0.0)
    return np.tile(np.fft.irfft(lines, n_period) * n_period / np.sqrt(driven.sum()), periods)


def sweep(first: float, last: float) -> Floats:
    """Return a linear sweep with two seconds of rest before it."""
    t = np.maximum(T - 2.0, 0.0)
    return np.sin(first * t + 0.5 * (last - first) / T[-1] * t**2)


def records_of(case: str, rng: np.random.Generator) -> list[Record]:
    still = np.zeros(N)

    def ms(periods: int = 1) -> Floats:
        return multisine(rng, periods=periods)

    pairs = {
        "multisines at once": [(ms(), ms())],
        "one at a time": [(ms(), still), (still, ms())],
        "periodic, at once": [(ms(4), ms(4))],
        "a sweep up and one down": [(sweep(1.0, 40.0), sweep(40.0, 1.0))],
        "sweeps, with and against each other": [
            (sweep(1.0, 40.0), sweep(1.0, 40.0)),
            (sweep(1.0, 40.0), -sweep(1.0, 40.0)),
        ],
    }
    return [recorded(left, right, rng) for left, right in pairs[case]]


@pytest.mark.parametrize(
    "case",
    [
        "multisines at once",
        "one at a time",
        "periodic, at once",
        "a sweep up and one down",
        "sweeps, with and against each other",
    ],
)
def test_every_response_is_found_with_an_honest_uncertainty(case: str) -> None:
    found = responses_of_inputs(records_of(case, np.random.default_rng(3)), INPUTS, OUTPUTS)
    assert not found.problems
    for source in INPUTS:
        for response in OUTPUTS:
            measured = found.found[source, response].band(4.0, 35.0)
            assert measured.omega.size > 30
            assert measured.unit == "m/N"
            assert measured.variance is not None
            error = np.abs(measured.values - truth(measured.omega, source, response)) ** 2
            # Variances from six degrees of freedom scatter: their median is what counts, that of an exponential law ln 2.
            assert 0.4 < np.median(error / measured.variance) / np.log(2.0) < 2.5
            peak = np.abs(truth(measured.omega, source, response)).max()
            assert np.sqrt(np.median(error)) < 0.01 * peak


@pytest.mark.parametrize("factor", [-1.0, 2.0])
def test_inputs_that_move_together_are_not_told_apart(factor: float) -> None:
    rng = np.random.default_rng(5)
    left = multisine(rng)
    found = responses_of_inputs([recorded(left, factor * left, rng)], INPUTS, OUTPUTS)
    assert not found.found
    assert found.together == (("left", "right"),)
    assert "changes together with 'right'" in found.problems["left", "x"]


def test_one_more_record_tells_them_apart() -> None:
    rng = np.random.default_rng(6)
    left = multisine(rng)
    together = recorded(left, left, rng)
    assert not responses_of_inputs([together], INPUTS, OUTPUTS).found
    alone = recorded(multisine(rng), np.zeros(N), rng)
    assert not responses_of_inputs([together, alone], INPUTS, OUTPUTS).problems


def test_an_input_that_rests_has_no_response_and_spoils_none() -> None:
    rng = np.random.default_rng(7)
    found = responses_of_inputs([recorded(multisine(rng), np.full(N, 0.3), rng)], INPUTS, OUTPUTS)
    assert set(found.found) == {("left", "x"), ("left", "z")}
    assert "does not change in any record" in found.problems["right", "z"]


def test_records_of_other_lengths_and_sample_times_are_read_together() -> None:
    rng = np.random.default_rng(8)
    slow = recorded(multisine(rng, 2000, dt=2 * DT), np.zeros(2000), rng, 2 * DT)
    quick = recorded(np.zeros(3000), multisine(rng, 3000), rng)
    found = responses_of_inputs([slow, quick], INPUTS, OUTPUTS)
    for (source, response), measured in found.found.items():
        inside = measured.band(4.0, 30.0)
        expected = truth(inside.omega, source, response)
        assert np.median(np.abs(inside.values - expected)) < 0.02 * np.abs(expected).max()
    assert set(found.found) == {(source, response) for source in INPUTS for response in OUTPUTS}


@pytest.mark.parametrize("poles", [0, 2])
def test_above_its_nyquist_frequency_a_slow_record_changes_nothing(poles: int) -> None:
    rng = np.random.default_rng(12)
    quick = recorded(multisine(rng), np.zeros(N), rng)
    slow = [recorded(multisine(rng, 260, dt=15 * DT), np.zeros(260), rng, 15 * DT) for _ in range(3)]
    nyquist = np.pi / slow[0].dt
    alone, beside = (
        responses_of_inputs(records, INPUTS[:1], ["x"], poles=poles).found["left", "x"].band(nyquist, 35.0)
        for records in ([quick], [quick, *slow])
    )
    assert beside.omega.size == alone.omega.size > 30
    assert beside.values == pytest.approx(alone.values)
    assert beside.variance == pytest.approx(alone.variance)
    assert beside.noise_freedom == alone.noise_freedom


def test_a_sensor_that_some_records_lack_is_read_from_the_others() -> None:
    rng = np.random.default_rng(9)
    first, second = (
        recorded(multisine(rng), multisine(rng), rng),
        recorded(multisine(rng), multisine(rng), rng),
    )
    lacking = replace(second, signals={n: s for n, s in second.signals.items() if n != "z"})
    found = responses_of_inputs([first, lacking], INPUTS, OUTPUTS)
    assert found.found["left", "z"].records == (first.name,)
    assert found.found["left", "x"].records == (first.name, lacking.name)
    nothing = responses_of_inputs([lacking], INPUTS, OUTPUTS)
    assert nothing.problems["left", "z"] == "no record contains 'z'."


def test_a_response_that_drowns_in_noise_is_said_to() -> None:
    rng = np.random.default_rng(10)
    found = responses_of_inputs([recorded(1e-4 * multisine(rng), multisine(rng), rng)], INPUTS, OUTPUTS)
    assert set(found.found) == {("right", "x"), ("right", "z")}
    assert "does not exceed its noise" in found.problems["left", "x"]


def test_steps_give_no_response() -> None:
    rng = np.random.default_rng(11)
    step = recorded((T > 5.0).astype(float), np.zeros(N), rng, kind="step")
    found = responses_of_inputs([step], INPUTS, OUTPUTS)
    assert "only has steps" in found.problems["left", "x"]
    assert "does not change in any record" in found.problems["right", "x"]


def test_without_inputs_there_is_nothing_to_respond_to() -> None:
    with pytest.raises(InputError, match="no input"):
        responses_of_inputs([], (), OUTPUTS)


@pytest.mark.parametrize("omega", [2.0 * np.pi, 7.0])
def test_a_single_tone_has_no_response_and_is_named(omega: float) -> None:
    rng = np.random.default_rng(3)
    found = responses_of_inputs([recorded(np.sin(omega * T), 0.0 * T, rng)], INPUTS, OUTPUTS)
    assert not found.found
    assert f"single frequency, {omega:.1f}"[:20] in found.problems["left", "x"]
    assert "Record a sweep or a multisine" in found.problems["left", "z"]
