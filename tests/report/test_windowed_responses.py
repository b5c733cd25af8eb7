"""Responses of records that are simulated window by window: those of the rig, whatever state each window starts from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lsim

from rigsight.compare.response_error import signal_paths
from rigsight.diagnose.result import Diagnosis, Trace
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.report.responses import record_responses
from rigsight.report.windowed_responses import windowed_response
from rigsight.rigs import RIGS

MASS, DAMPING, GAIN = 2.0, 3.0, 10.0
DT, SAMPLES, WINDOW = 0.005, 12_000, 6.0
(PATH,) = signal_paths(RIGS["axis"])


def driven() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return time, input and displacement of a mass without a spring, in windows that each start from a state of its own."""
    rng = np.random.default_rng(5)
    t = DT * np.arange(SAMPLES)
    omega = 2.0 * np.pi * np.arange(0.1, 8.0, 0.0731)
    u = np.sum(np.cos(np.outer(omega, t) + rng.uniform(0.0, 2.0 * np.pi, omega.size)[:, None]), axis=0)
    system = ([GAIN], [MASS, DAMPING, 0.0])
    size = round(WINDOW / DT)
    parts = [
        lsim(system, u[i : i + size], t[:size], X0=rng.standard_normal(2))[1] for i in range(0, SAMPLES, size)
    ]
    return t, u, np.concatenate(parts)


@pytest.fixture(scope="module")
def record() -> Record:
    _, u, x = driven()
    return Record("stage", DT, {"u": u, "x": x}, {"u": "input", "x": "m"}, kind="multisine", hold="foh")


def test_the_response_is_that_of_the_rig(record: Record) -> None:
    found = windowed_response(record, WINDOW, PATH, "local_rational", clear=True)
    s = 1j * found.omega
    truth = GAIN / (MASS * s**2 + DAMPING * s)
    inside = (found.omega > 3.0) & (found.omega < 40.0)
    assert np.count_nonzero(inside) > 25
    assert np.max(np.abs(found.values / truth - 1.0)[inside]) < 0.05


def test_read_over_the_ends_of_the_windows_it_would_be_another(record: Record) -> None:
    whole = windowed_response(record, SAMPLES * DT, PATH, "local_rational", clear=False)
    s = 1j * whole.omega
    inside = (whole.omega > 10.0) & (whole.omega < 40.0)
    off = np.abs(whole.values / (GAIN / (MASS * s**2 + DAMPING * s)) - 1.0)[inside]
    assert np.median(off) > 0.05


def test_windows_too_short_to_read_are_said_to_be(record: Record) -> None:
    with pytest.raises(InputError, match="show no frequency response"):
        windowed_response(record, 10 * DT, PATH, "local_rational", clear=True)


def test_measured_and_simulated_go_through_one_estimator(diagnosis: Diagnosis) -> None:
    t, u, x = driven()
    trace = Trace(
        "stage", "validation", "multisine", 1.0, t, {"u": u}, {"x": x}, {"x": 2.0 * x}, {"x": x}, {"x": x}
    )
    windowed = replace(
        diagnosis, rig="axis", windows=WINDOW, traces=(trace,), effects=(), units={"u": "input", "x": "m"}
    )
    (response,) = record_responses(windowed, trace)
    assert response.path == "u -> x"
    assert response.decibel["before"] == pytest.approx(20.0 * np.log10(2.0), abs=1e-9)
    assert response.decibel["reidentified"] == pytest.approx(0.0, abs=1e-9)
    assert record_responses(windowed, replace(trace, kind="step")) == ()


def test_a_record_with_windows_too_short_has_no_picture(variant: Callable[[str], Diagnosis]) -> None:
    windowed = replace(variant("effect"), windows=0.05)
    assert record_responses(windowed, windowed.traces[0]) == ()
