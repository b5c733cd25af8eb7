from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rigsight.diagnose.result import Diagnosis
from rigsight.report.figures import (
    ChartPanel,
    Curve,
    chart_data,
    curve_names,
    points_per_curve,
)
from rigsight.report.record_views import record_charts


def drawn(x: np.ndarray, y: np.ndarray, name: str = "m", title: str = "x") -> dict[str, Any]:
    curve = Curve("measured", name, y)
    data = chart_data(title, "time [s]", x, [ChartPanel("x", 1, [curve], (-1.0, 1.0))])
    assert "<" not in data
    return json.loads(data)


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=50), st.floats(-1e6, 1e6))
def test_numbers_keep_what_a_screen_shows_of_their_range(numbers: list[float], offset: float) -> None:
    values = np.array(numbers) + offset
    found = drawn(np.arange(values.size, dtype=float), values)["panels"][0]["curves"][0]["y"]
    reach = np.ptp(values) or abs(values[0])
    assert np.max(np.abs(found - values)) <= 1e-4 * reach


def test_what_is_not_finite_is_a_gap() -> None:
    x = np.arange(5.0)
    for values, expected in (
        (np.array([1.0, np.nan, 3.0, np.inf, -np.inf]), [1.0, None, 3.0, None, None]),
        (np.full(5, np.nan), [None] * 5),
        (np.zeros(5), [0.0] * 5),
    ):
        assert drawn(x, values)["panels"][0]["curves"][0]["y"] == expected


def test_neighbors_on_the_axis_stay_apart() -> None:
    x = 1e3 + 1e-5 * np.arange(1000)
    np.testing.assert_allclose(np.diff(drawn(x, x)["x"]), 1e-5, rtol=0.2)


def test_no_text_can_end_the_script_that_holds_it() -> None:
    title = '</script><script>alert(1)</script> & "quoted"'
    content = drawn(np.arange(3.0), np.arange(3.0), "<b>", title)
    assert content["title"] == title
    assert content["panels"][0]["curves"][0]["name"] == "<b>"


def test_curves_get_fewer_points_where_there_are_more_of_them() -> None:
    points = [points_per_curve(n) for n in (1, 70, 300, 10_000)]
    assert points == sorted(points, reverse=True)
    assert 70 * points[1] <= 170_000
    assert points[-1] == 600


def test_stages_that_are_the_same_simulation_are_drawn_once(
    diagnosis: Diagnosis, variant: Callable[[str], Diagnosis]
) -> None:
    assert list(curve_names(diagnosis)) == ["measured", "before", "reidentified", "after"]
    assert curve_names(variant("nothing given")) == {
        "measured": "measured", "reidentified": "identified", "after": "with effect",
    }  # fmt: skip
    assert list(curve_names(variant("unknown"))) == ["measured", "before", "reidentified"]
    assert curve_names(variant("two effects"))["after"] == "with effects"


def test_records_over_unix_time_are_drawn_from_their_first_stamp(diagnosis: Diagnosis) -> None:
    (trace, *_) = diagnosis.traces
    later = replace(trace, t=trace.t + 1.7e9)
    plain, late = (next(record_charts(replace(diagnosis, traces=(one,)), {}))[1][0] for one in (trace, later))
    at_zero, moved = (json.loads(chart.data) for chart in (plain, late))
    assert moved["label"].startswith("time [s] since 17000000")
    assert at_zero["label"] == "time [s]"
    np.testing.assert_allclose(np.ptp(moved["x"]), np.ptp(at_zero["x"]), rtol=1e-3)
    assert late.still is not None
    assert "time [s] since 17000000" in late.still.image
    assert "1.7e+09" not in late.still.image


def test_a_long_record_is_drawn_with_its_peaks(diagnosis: Diagnosis) -> None:
    (trace, *_) = diagnosis.traces
    n = 50_000
    t = 0.001 * np.arange(n)
    psi = 0.05 * np.sin(t)
    psi[31_234] = 0.15
    off = 0.9 * psi
    off[7_777] = -0.12
    signals = {"measured": psi, "before": off, "reidentified": off, "after": psi}
    made = replace(trace, t=t, inputs={"u": t}, **{name: {"psi": own} for name, own in signals.items()})
    ((_, charts),) = record_charts(replace(diagnosis, traces=(made,)), {})
    content = json.loads(charts[0].data)
    assert 2_000 < len(content["x"]) <= 6_000
    above, below = (panel["curves"] for panel in content["panels"])
    assert max(above[0]["y"]) == pytest.approx(150.0)
    assert min(above[1]["y"]) == pytest.approx(-120.0)
    assert above[0]["y"][content["x"].index(31.234)] == pytest.approx(150.0)
    assert below[0]["name"] == "twice the noise floor"
    assert f"Of {n} samples {len(content['x'])} are drawn" in charts[0].caption
