from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from rigsight import plot
from rigsight.diagnose.location.trace import Trace
from rigsight.frequency import FrequencyResponse


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


@pytest.mark.slow
def test_importing_the_figures_does_not_import_matplotlib() -> None:
    code = "import sys, rigsight.plot, rigsight.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=180).returncode == 0


def test_drawing_leaves_the_style_of_a_notebook_alone() -> None:
    import matplotlib as mpl

    with mpl.rc_context({"font.size": 21.0}):
        with plot.style():
            assert mpl.rcParams["font.size"] == 9.0
        assert mpl.rcParams["font.size"] == 21.0


def pt2(omega: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / (1.0 - (omega / 12.0) ** 2 + 0.2j * omega / 12.0))


def panel(n_lines: int = 200, label: str = "") -> plot.Panel:
    """A PT2 that is measured with an error of 2 % and fitted exactly."""
    omega = np.linspace(1.0, 60.0, n_lines)
    truth = pt2(omega)
    grid = np.linspace(1.0, 60.0, 400)
    rng = np.random.default_rng(0)
    error = 0.02 * np.abs(truth) * (rng.normal(size=n_lines) + 1j * rng.normal(size=n_lines)) / np.sqrt(2.0)
    measured = FrequencyResponse(
        omega, truth + error, "u", "psi", "rad/A", variance=(0.02 * np.abs(truth)) ** 2
    )
    return plot.Panel(
        "u to psi", measured, plot.FittedCurve(grid, pt2(grid), 0.01 * np.abs(pt2(grid)), "PT2"), label
    )


def test_a_bode_plot_shows_magnitude_and_phase_in_db_and_degrees() -> None:
    figure = plot.bode([panel(), panel()])
    assert len(figure.axes) == 4
    magnitude, phase = figure.axes[0], figure.axes[2]
    assert magnitude.get_ylabel() == "magnitude [dB re 1 rad/A]"
    assert phase.get_ylabel() == "phase [deg]"
    assert phase.get_xlabel() == "angular frequency [rad/s]"
    fitted = magnitude.lines[1]
    assert np.max(fitted.get_ydata()) == pytest.approx(20.0 * np.log10(5.0), abs=0.2)
    assert np.min(phase.lines[1].get_ydata()) == pytest.approx(-178.0, abs=2.0)


def test_a_wild_line_does_not_turn_the_phase_of_those_after_it() -> None:
    whole = panel()
    values = np.array(whole.measured.values)
    values[100] *= np.exp(1j * np.pi)
    measured = FrequencyResponse(whole.measured.omega, values, "u", "psi", "rad/A")
    figure = plot.bode([plot.Panel("wild", measured, whole.fitted)])
    points = np.asarray(figure.axes[1].lines[0].get_ydata())
    expected = np.degrees(np.angle(pt2(whole.measured.omega)))
    assert np.max(np.abs(np.delete(points - expected, 100))) < 10.0


def test_a_bode_plot_of_many_lines_stays_small() -> None:
    assert len(plot.svg_text(plot.bode([panel(20_000)]), "many")) < 600_000


def test_the_same_figure_is_the_same_text() -> None:
    assert plot.svg_text(plot.bode([panel()]), "a") == plot.svg_text(plot.bode([panel()]), "a")


def test_overlaid_responses_name_every_amplitude_once() -> None:
    figure = plot.overlaid_responses([[panel(label="0.25 A"), panel(label="1 A")], [panel(label="1 A")]])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["0.25 A", "1 A", "fitted"]


def test_parameters_over_amplitude_carry_their_intervals() -> None:
    points = (
        plot.AmplitudePoint(0.25, "sweep", 800.0, 10.0),
        plot.AmplitudePoint(1.0, "sweep", 80.0, 1.0),
        plot.AmplitudePoint(0.6, "step", 99.0, np.nan),
    )
    panels = [
        plot.AmplitudePanel("k_c", "N m/rad", points, (90.0, 1.0)),
        plot.AmplitudePanel("J_z", "kg m^2", points),
    ]
    figure = plot.amplitude_dependence(panels, "amplitude of u [A]")
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["k_c [N m/rad]", "J_z [kg m^2]"]
    (bars, _) = figure.axes[0].containers
    low, high = bars.lines[2][0].get_segments()[0][:, 1]
    assert (low, high) == (pytest.approx(800.0 - 19.6), pytest.approx(800.0 + 19.6))
