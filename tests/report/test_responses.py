from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.report import record_views
from rigsight.report.record_views import amplitude_figures, record_responses


def test_measured_and_simulated_go_through_one_estimator(diagnosis: Diagnosis) -> None:
    trace = diagnosis.traces[0]
    louder = {output: 2.0 * samples for output, samples in trace.measured.items()}
    same = replace(trace, before=louder, reidentified=trace.measured, after=trace.after)
    found = {response.path: response for response in record_responses(diagnosis, same)}
    assert set(found) == {"u -> psi", "psi -> y"}
    # Exactly the measured record again, and exactly twice of it: whatever the estimator does, it does to both.
    assert found["u -> psi"].decibel["reidentified"] == pytest.approx(0.0, abs=1e-9)
    assert found["u -> psi"].decibel["before"] == pytest.approx(20.0 * np.log10(2.0), abs=1e-9)
    assert found["psi -> y"].decibel["before"] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < found["u -> psi"].decibel["after"] < 1.0


def test_there_is_no_response_of_a_step_or_an_element(
    diagnosis: Diagnosis, variant: Callable[[str], Diagnosis]
) -> None:
    step = replace(diagnosis.traces[0], kind="step")
    assert record_responses(diagnosis, step) == ()
    element = variant("element")
    assert record_responses(element, element.traces[0]) == ()


def test_a_simulation_that_left_the_numbers_leaves_the_others(diagnosis: Diagnosis) -> None:
    trace = diagnosis.traces[0]
    lost = replace(trace, before={output: np.full(trace.t.size, np.nan) for output in trace.measured})
    for response in record_responses(diagnosis, lost):
        assert set(response.simulated) == {"reidentified", "after"}


def test_amplitudes_are_overlaid_only_where_there_are_several(diagnosis: Diagnosis) -> None:
    responses = {trace.record: record_responses(diagnosis, trace) for trace in diagnosis.traces}
    (path, figures), _ = amplitude_figures(diagnosis, responses)
    assert path == "u \u2192 psi"
    assert len(figures) == 3
    assert "0.25 A" in figures[0].caption
    assert "0.75 A" in figures[0].caption
    one = replace(diagnosis, traces=diagnosis.traces[:1])
    assert amplitude_figures(one, responses) == []


def of_an_arm(diagnosis: Diagnosis) -> Diagnosis:
    """Two torques move two angles at once; the second simulation is half as large as what was measured."""
    rng = np.random.default_rng(3)
    t = 0.01 * np.arange(4000)
    inputs = {f"tau_{i}": np.convolve(rng.standard_normal(t.size), np.ones(9) / 9.0, "same") for i in (1, 2)}
    lag = np.exp(-np.arange(300) / 40.0) / 40.0
    first, second = (np.convolve(own, lag)[: t.size] for own in inputs.values())
    measured = {"angle_1": first + 0.3 * second, "angle_2": second - 0.2 * first}
    half = {name: 0.5 * own for name, own in measured.items()}
    shown = Trace("both", "validation", "operation", None, t, inputs, measured, half, measured, measured)
    gap = dict.fromkeys(measured, diagnosis.gap["psi"])
    units = {"tau_1": "N m", "tau_2": "N m", "angle_1": "rad", "angle_2": "rad"}
    return replace(diagnosis, rig="two_link_arm", traces=(shown,), gap=gap, units=units, effects=(), where=())


def test_of_inputs_that_move_at_once_each_path_is_shown(diagnosis: Diagnosis) -> None:
    arm = of_an_arm(diagnosis)
    found = {response.path: response for response in record_responses(arm, arm.traces[0])}
    assert set(found) == {f"tau_{i} -> angle_{j}" for i in (1, 2) for j in (1, 2)}
    for response in found.values():
        assert response.decibel["reidentified"] == pytest.approx(0.0, abs=1e-9)
        assert response.decibel["before"] == pytest.approx(20.0 * np.log10(2.0), abs=1e-6)
    low = found["tau_2 -> angle_1"].measured
    assert np.abs(low.values[0] / found["tau_1 -> angle_1"].measured.values[0]) == pytest.approx(
        0.3, rel=0.05
    )


def test_of_very_many_paths_those_to_the_worst_sensors_are_shown(
    diagnosis: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record_views, "_MOST_PATHS", 2)
    arm = of_an_arm(diagnosis)
    worse = {**arm.gap, "angle_2": replace(arm.gap["angle_2"], reidentified=0.5)}
    found = record_responses(replace(arm, gap=worse), arm.traces[0])
    assert [response.path for response in found] == ["tau_1 -> angle_2", "tau_2 -> angle_2"]
