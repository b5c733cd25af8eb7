from __future__ import annotations

import base64
import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rigsight.diagnose.result import Diagnosis
from rigsight.report.drawing.charts import (
    ChartPanel,
    Curve,
    chart_data,
    curve_names,
    packed,
    points_per_curve,
)
from rigsight.report.record_views import record_views


def unpacked(content: dict[str, object]) -> np.ndarray:
    whole = np.frombuffer(base64.b64decode(str(content["data"])), dtype="<i2").astype(float)
    values = float(content["middle"]) + float(content["step"]) * whole
    return np.where(whole == -32768, np.nan, values)


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=50))
def test_packed_numbers_come_back_to_a_65000th_of_their_range(numbers: list[float]) -> None:
    values = np.array(numbers)
    reach = float(np.ptp(values))
    # Half a step, and the seven digits of middle and step.
    assert np.max(np.abs(unpacked(packed(values)) - values)) <= reach / 131_000 + 1e-6 * np.max(
        np.abs(values)
    )


def test_what_is_not_finite_comes_back_as_a_gap() -> None:
    values = np.array([1.0, np.nan, 3.0, np.inf, -np.inf])
    assert np.isnan(unpacked(packed(values))).tolist() == [False, True, False, True, True]
    assert np.isnan(unpacked(packed(np.full(3, np.nan)))).all()


def test_places_that_are_not_equally_spaced_come_back_finer_than_their_distance() -> None:
    x = np.sort(np.random.default_rng(3).uniform(0.0, 100.0, 3000))
    data = chart_data("x", ("t", "s"), [ChartPanel("x", 1, [Curve("measured", x, x)])], {"measured": "m"})
    (curve,) = json.loads(data)["panels"][0]["curves"]
    assert np.max(np.abs(unpacked(curve["x"]) - x)) < 0.1 * 100.0 / 3000
    even = 2.5 + 0.005 * np.arange(10_000)
    data = chart_data(
        "x", ("t", "s"), [ChartPanel("x", 1, [Curve("measured", even, even)])], {"measured": "m"}
    )
    assert json.loads(data)["panels"][0]["curves"][0]["x"] == [2.5, 0.005]


def test_no_text_can_end_the_script_that_holds_it() -> None:
    x = np.arange(3.0)
    title = '</script><script>alert(1)</script> & "quoted"'
    data = chart_data(title, ("t", "s"), [ChartPanel("x", 1, [Curve("measured", x, x)])], {"measured": "<b>"})
    assert "<" not in data
    assert json.loads(data)["title"] == title


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
    plain, late = (
        next(iter(record_views(replace(diagnosis, traces=(one,)), {}))).charts[0] for one in (trace, later)
    )
    drawn, moved = (json.loads(chart.data) for chart in (plain, late))
    assert moved["label"].startswith("time [s] since 17000000")
    assert drawn["label"] == "time [s]"
    np.testing.assert_allclose(np.diff(moved["range"]), np.diff(drawn["range"]), rtol=1e-3)
    for figure in late.drawings:
        assert "time [s] since 17000000" in figure.image
        assert "1.7e+09" not in figure.image
