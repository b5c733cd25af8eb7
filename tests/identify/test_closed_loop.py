"""The reference of a closed loop as instrument: frequency responses that noise on the input does not bias, and what is told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import scipy.linalg

from rigsight.errors import InputError
from rigsight.frequency import local_polynomial_response, local_rational_response
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.record_identification import EstimationOptions
from rigsight.identify.transfer.record_response import RecordResponse, record_response
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.workflow.campaign.in_memory import make_campaign
from rigsight.workflow.identify import identify_campaign

M, D, K = 2.0, 5.0, 200.0
DT, N = 2e-3, 4000
LINES = 2.0 * np.pi * np.arange(0.25, 8.0, 0.375)


@cache
def loop(noise: float = 0.2, amplitude: float = 0.02, seed: int = 1) -> Record:
    """Return an axis that a position controller leads along a multisine, with white noise on the recorded input."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(N)
    phases = rng.uniform(0.0, 2.0 * np.pi, LINES.size)
    reference = amplitude / LINES.size * np.sum(np.cos(LINES[:, None] * t + phases[:, None]), axis=0)
    whole = scipy.linalg.expm(DT * np.array([[0.0, 1.0, 0.0], [-K / M, -D / M, 1.0 / M], [0.0, 0.0, 0.0]]))
    states, u = np.zeros((N, 2)), np.zeros(N)
    for i in range(N):
        u[i] = 3000.0 * (reference[i] - states[i, 0]) - 120.0 * states[i, 1]
        if i + 1 < N:
            states[i + 1] = whole[:2, :2] @ states[i] + whole[:2, 2] * u[i]
    x = states[:, 0] + 1e-7 * rng.standard_normal(N)
    noisy = u + noise * np.std(u) * rng.standard_normal(N)
    signals = {"u": noisy, "x": x, "reference": reference}
    return Record(f"loop_{amplitude}", DT, signals, {"u": "N", "x": "m"}, kind="multisine", hold="zoh")


def read(record: Record, instrument: str | None = "reference", **options: object) -> RecordResponse:
    return record_response(record, "u", "x", "pt2", hold="zoh", instrument=instrument, **options)  # type: ignore[arg-type]


def errors(seen: RecordResponse) -> np.ndarray:
    """Return the relative errors at the lines of the reference."""
    found = seen.response
    near = [int(np.argmin(np.abs(found.omega - line))) for line in LINES]
    near = [i for i, line in zip(near, LINES, strict=True) if abs(found.omega[i] - line) < 0.05]
    omega = found.omega[near]
    return np.asarray(np.abs(found.values[near] * (K - M * omega**2 + 1j * D * omega) - 1.0))


@pytest.mark.parametrize("method", ["local_rational", "local_polynomial"])
def test_noise_on_the_input_does_not_bias_what_the_instrument_shows(method: str) -> None:
    """Noise on the input makes the direct estimate too small, by the same share in every draw."""
    shown: dict[str | None, list[float]] = {None: [], "reference": []}
    for seed in range(6):
        record = loop(noise=2.0, seed=seed)
        for name, ratios in shown.items():
            found = read(record, name, method=method, least_clearness=0.0).response
            near = [int(np.argmin(np.abs(found.omega - line))) for line in LINES[8:18]]
            omega = found.omega[near]
            ratios += list(np.real(found.values[near] * (K - M * omega**2 + 1j * D * omega)))
    direct, by_reference = (abs(float(np.mean(ratios)) - 1.0) for ratios in shown.values())
    assert direct > 0.1
    assert by_reference < 0.5 * direct


def test_without_noise_the_instrument_shows_the_rig() -> None:
    assert np.max(errors(read(loop(0.0)))) < 0.01


@pytest.mark.parametrize("estimator", [local_rational_response, local_polynomial_response])
def test_the_variance_is_that_of_the_errors(estimator) -> None:  # type: ignore[no-untyped-def]
    scatter, reported = [], []
    for seed in range(8):
        found = estimator(loop(0.05, seed=seed), "u", "x", hold="zoh", instrument="reference", wanted=LINES)
        near = [int(np.argmin(np.abs(found.omega - line))) for line in LINES[4:12:2]]
        omega = found.omega[near]
        scatter.append(np.abs(found.values[near] - 1.0 / (K - M * omega**2 + 1j * D * omega)) ** 2)
        reported.append(found.variance[near])
    assert 0.5 < np.median(scatter) / np.log(2.0) / np.median(reported) < 2.0


def test_a_reference_that_drives_nothing_is_not_used_and_that_is_told() -> None:
    unrelated = loop().with_signals(reference=np.cumsum(np.random.default_rng(2).standard_normal(N)))
    seen = read(unrelated)
    assert "is not correlated with the instrument 'reference'" in seen.unused_instrument
    np.testing.assert_array_equal(seen.response.values, read(unrelated, None).response.values)
    with pytest.raises(InputError, match="not correlated with the instrument"):
        local_rational_response(unrelated, "u", "x", instrument="reference")


def test_a_method_without_use_for_an_instrument_says_so() -> None:
    assert "'h1' does not use it" in read(loop(), method="h1").unused_instrument


def test_identify_tells_what_the_reference_was_used_for() -> None:
    campaign = make_campaign("axis", [loop(0.02), loop(0.02, 0.01)], constants={"gain": 1.0})
    found = identify_campaign(campaign, EstimationOptions())
    (reported,) = [text for text in found.warnings if "closed-loop records" in text]
    assert "'loop_0.02', 'loop_0.01'" in reported
    assert "instrument" in reported
    assert all("by reference" in record.motion.measured.method for record in found.records)  # type: ignore[union-attr]


def test_a_reference_that_never_changes_is_told_and_none_is_not() -> None:
    still = loop().with_signals(reference=np.ones(N))
    (reported,) = closed_loop_notes([still], AXIS, "It is used.")
    assert "never changes" in reported
    bare = Record("bare", DT, {"u": loop()["u"], "x": loop()["x"]}, {})
    assert closed_loop_notes([bare], AXIS, "It is used.") == []
