from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from rigsight import plot
from rigsight.diagnose.result import Trace


def record(before_error: np.ndarray, n_samples: int = 6000) -> Trace:
    t = 0.01 * np.arange(n_samples)
    wave = {"x": np.sin(2 * np.pi * t)}
    before = {"x": wave["x"] + before_error}
    return Trace("r", "validation", "sweep", None, t, {}, wave, before, before, wave)


def test_an_envelope_keeps_every_peak_and_the_order_of_time() -> None:
    values = np.random.default_rng(0).standard_normal(50_000)
    values[31_234] = 40.0
    t = np.arange(values.size, dtype=float)
    short_t, short = plot.envelope(t, values, 500)
    assert short.size <= 1000
    assert np.max(short) == 40.0
    assert np.min(short) == np.min(values)
    assert np.all(np.diff(short_t) > 0.0)


def test_a_short_line_stays_as_it_is() -> None:
    t = np.arange(10.0)
    assert plot.envelope(t, t, 5)[1] is t


def test_an_envelope_of_gaps_is_a_gap() -> None:
    values = np.full(5000, np.nan)
    values[:100] = 1.0
    short = plot.envelope(np.arange(5000.0), values, 100)[1]
    assert np.nanmax(short) == 1.0
    assert np.isnan(short[-1])


@pytest.mark.parametrize(
    ("unit", "size", "factor", "shown"),
    [
        ("rad", 0.01, 1e3, "mrad"), ("m", 3e-6, 1e6, "µm"), ("m", 0.5, 1.0, "m"), ("N", 1.2e4, 1e-3, "kN"), ("m", 0.0, 1.0, "m"),
        ("1", 1e-3, 1.0, "1"), ("N/m", 1e5, 1.0, "N/m"), ("rad", float("nan"), 1.0, "rad"), ("m", 1e-15, 1e9, "nm"),
    ],
)  # fmt: skip
def test_quantities_are_shown_in_handy_units(unit: str, size: float, factor: float, shown: str) -> None:
    scale = plot.display_scale(unit, size)
    assert scale.factor == pytest.approx(factor)
    assert scale.unit == shown


def test_the_detail_lies_where_the_given_simulation_errs_most() -> None:
    error = np.zeros(6000)
    error[4000:4100] = 0.5
    window = plot.detail_window(record(error), "x")
    assert window.start <= 4000
    assert window.stop >= 4100
    assert window.stop - window.start <= 600


def test_a_detail_of_few_samples_is_the_record() -> None:
    window = plot.detail_window(record(np.zeros(20), 20), "x")
    assert (window.start, window.stop) == (0, 20)


def test_importing_the_figures_does_not_import_matplotlib() -> None:
    code = "import sys, rigsight.plot, rigsight.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


def test_drawing_leaves_the_style_of_a_notebook_alone() -> None:
    import matplotlib as mpl

    with mpl.rc_context({"font.size": 21.0}):
        with plot.style():
            assert mpl.rcParams["font.size"] == 9.0
        assert mpl.rcParams["font.size"] == 21.0
