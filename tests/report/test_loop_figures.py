"""The force of an element over its motion: one picture per amplitude, whole loops, numbers of what is drawn."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rigsight.diagnose.location.trace import Trace
from rigsight.diagnose.result import Diagnosis
from rigsight.report.figures import loop_figures


def sine_trace(n_periods: int, worst: int) -> Trace:
    """Twenty samples a second of a sine of one period per second; the given element errs most in one of the periods."""
    t = np.arange(100 * n_periods) / 100.0
    x = 0.01 * np.sin(2.0 * np.pi * t)
    force = 1000.0 * x
    off = np.where((t >= worst) & (t < worst + 1), 4.0, 0.5)
    return Trace(
        "sine", "validation", "operation", None, t, {"x": x}, {"force": force}, {"force": force + off},
        {"force": force + 0.5 * off}, {"force": force},
    )  # fmt: skip


def test_each_amplitude_has_a_picture_of_its_scored_record(variant: Callable[[str], Diagnosis]) -> None:
    captions = [figure.caption for figure in loop_figures(variant("loops"))]
    assert [re.search(r"record (.*), motion", caption)[1] for caption in captions] == [
        "bench small", "bench large again",
    ]  # fmt: skip


def test_whole_periods_are_drawn_where_the_given_element_errs_most(
    variant: Callable[[str], Diagnosis],
) -> None:
    (figure,) = loop_figures(replace(variant("loops"), traces=(sine_trace(30, 20),)))
    found = re.search(
        r"motion of ±10 mm: ([\d.]+) s to ([\d.]+) s, where the error is largest", figure.caption
    )
    assert found, figure.caption
    begin, end = float(found[1]), float(found[2])
    assert abs(end - begin - 4.0) <= 0.02
    assert begin <= 20.0 <= 21.0 <= end + 0.2


def test_a_short_record_is_drawn_whole_and_its_errors_are_those_of_the_picture(
    variant: Callable[[str], Diagnosis],
) -> None:
    trace = sine_trace(5, 2)
    (figure,) = loop_figures(replace(variant("loops"), traces=(trace,)))
    assert ": 0 s to 4.99 s. " in figure.caption
    # RMS of four periods off by 0.5 N and one by 4 N, over a sine of 10 N.
    expected = np.sqrt((4 * 0.25 + 16.0) / 5.0) / (10.0 / np.sqrt(2.0))
    assert f"given simulation {100 * expected:.3g} %, re-identified {50 * expected:.3g} %" in figure.caption


def test_a_simulation_that_left_the_numbers_does_no_harm(variant: Callable[[str], Diagnosis]) -> None:
    trace = sine_trace(5, 2)
    lost = replace(trace, before={"force": np.full(trace.t.size, np.nan)})
    (figure,) = loop_figures(replace(variant("loops"), traces=(lost,)))
    assert "given simulation not finite" in figure.caption


def test_a_driven_rig_has_no_loops(diagnosis: Diagnosis) -> None:
    assert loop_figures(diagnosis) == []
