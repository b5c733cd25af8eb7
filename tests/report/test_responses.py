from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.report.drawing.response_charts import amplitude_figures
from rigsight.report.responses import record_responses


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
