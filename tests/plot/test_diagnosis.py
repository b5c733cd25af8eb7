"""Which part of a record is worth a look of its own: of a step, the step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.location.trace import Trace
from rigsight.plot import detail_window, step_window

DT = 0.01
START = 10.0


def stepped(time_constant: float = 0.4, noise: float = 1e-3, kind: str = "step", back: float = 99.0) -> Trace:
    t = DT * np.arange(3000)
    u = np.where((t >= START) & (t < back), 1.0, 0.0)
    rise = 1.0 - np.exp(-np.maximum(t - START, 0.0) / time_constant)
    x = rise + noise * np.random.default_rng(1).standard_normal(t.size)
    # The simulation errs most long before the step.
    off = x + np.where((t > 2.0) & (t < 3.0), 5.0, 0.0)
    return Trace("step", "validation", kind, 1.0, t, {"u": u}, {"x": x}, {"x": off}, {"x": off}, {"x": off})


@pytest.mark.parametrize("time_constant", [0.2, 0.4, 1.0])
def test_a_step_is_seen_from_before_it_until_it_has_settled(time_constant: float) -> None:
    trace = stepped(time_constant)
    window = step_window(trace, "x")
    assert window is not None
    assert detail_window(trace, "x") == window
    begin, end = trace.t[window.start], trace.t[window.stop - 1]
    assert begin < START
    # Five percent are left after three time constants; not ten of them in empty time.
    assert START + 3.0 * time_constant <= end <= START + 6.0 * time_constant
    assert START - begin < 0.25 * (end - START)


def test_noise_does_not_stretch_it_and_a_jump_back_ends_it() -> None:
    noisy = step_window(stepped(noise=0.05), "x")
    assert noisy is not None
    assert noisy.stop * DT < START + 4.0
    ended = step_window(stepped(time_constant=3.0, back=12.0), "x")
    assert ended is not None
    assert ended.stop * DT <= 12.01


def test_a_simulation_that_rings_on_is_seen_for_a_while() -> None:
    trace = stepped(time_constant=0.4)
    short = step_window(trace, "x")
    ringing = trace.measured["x"] + 0.8 * np.where(
        trace.t > START, np.exp(-0.5 * (trace.t - START)) * np.cos(9.0 * (trace.t - START)), 0.0
    )
    longer = step_window(replace(trace, before={"x": ringing}), "x")
    endless = np.where(trace.t > START, np.cos(9.0 * trace.t), 0.0)
    longest = step_window(replace(trace, before={"x": endless}), "x")
    assert short is not None
    assert longer is not None
    assert longest is not None
    assert short.stop + 200 < longer.stop <= longest.stop
    assert longest.stop * DT < START + 5.5 * (short.stop * DT - START)


def test_what_is_no_step_shows_its_largest_error() -> None:
    trace = stepped(kind="sweep")
    assert step_window(trace, "x") is None
    assert trace.t[detail_window(trace, "x").start] < 3.0
    still = replace(stepped(), inputs={"u": np.zeros(3000)})
    assert step_window(still, "x") is None
