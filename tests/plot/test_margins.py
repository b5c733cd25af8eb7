"""Figures whose margins are fixed: nothing is cut off at their edges, and no label stands on the numbers of its axis."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from rigsight import plot
from rigsight.diagnose.location.gap_parts import BandPart, RecordPart, TimePart
from rigsight.diagnose.location.trace import Stage
from rigsight.frequency import FrequencyResponse
from rigsight.plot.drawing import new_figure

STAGES: dict[Stage, str] = {
    "before": "given simulation", "reidentified": "re-identified", "after": "with effects"
}  # fmt: skip


def gaps(size: float) -> dict[str, float]:
    return {
        "before": 3.0 * size, "reidentified": 1.3 * size, "after": 2e-3 * size, "noise_floor": 1e-3 * size, "share": 0.3,
        "noise_share": 0.01,
    }  # fmt: skip


def bands(size: float) -> Figure:
    parts = [
        BandPart(**gaps(size), output="x", omega_low=110.0 * i, omega_high=110.0 * (i + 1), excited=i < 8)
        for i in range(9)
    ]
    labels = [f"{part.omega_low:.3g}\nto {part.omega_high:.3g}" for part in parts]
    return plot.gap_bars(parts, labels, STAGES, "frequency [rad/s]")


def records(size: float) -> Figure:
    parts = [
        RecordPart(
            **gaps(size), output="x", record="r", role="validation", kind="sweep", amplitude=0.5, scored=True, n_samples=9,
            duration=0.1, measured_rms=1.0, rms=1.0, freedom=9.0, interval={},
        )
        for _ in range(3)
    ]  # fmt: skip
    return plot.gap_bars(parts, ["1", "2", "3"], STAGES, "record")


def times(size: float) -> Figure:
    return plot.gap_times(
        [
            TimePart(**gaps(size * (1.0 + i)), output="x", record=f"r{i % 2}", t_start=i, t_end=i + 1, omega=1.0, mean=0.0)
            for i in (0.0, 2.0, 4.0, 1.0, 3.0, 5.0)
        ],
        STAGES,
    )  # fmt: skip


def response(size: float, label: str = "") -> FrequencyResponse:
    omega = np.geomspace(0.013, 1234.0, 60)
    values = size / (100.0 - omega**2 + 2j * omega)
    return FrequencyResponse(
        omega, values, "u", "psi", "rad/input", variance=1e-4 * np.abs(values) ** 2, method=label
    )


def overlaid(size: float) -> Figure:
    curve = plot.FittedCurve(response(size).omega, response(size).values, np.zeros(60), "fit")
    panels = [plot.Panel("Re-identified", response(size), curve, f"{0.25 * i} A") for i in range(1, 8)]
    return plot.overlaid_responses([panels, panels], "simulated")


def models(size: float) -> Figure:
    names = ["given simulation", "re-identified", "with effect", "a fourth model"]
    panel = plot.ResponsesPanel("u to psi", response(size), dict.fromkeys(names, response(size)))
    return plot.model_responses([panel, panel], plot.model_styles(names))


def loops(size: float) -> Figure:
    t = np.linspace(0.0, 6.0, 200)
    force = 1234.0 * size * np.cos(t)
    loop = plot.ForceLoop(
        "x", "force", "m", "N", 0.0123 * np.sin(t), 0.0123 * np.cos(t), force, dict.fromkeys(STAGES, force)
    )
    return plot.force_loops(loop, STAGES)


@pytest.mark.parametrize("size", [1.0, 3e-5, 4e3])
@pytest.mark.parametrize("draw", [bands, records, times, overlaid, models, loops], ids=lambda f: f.__name__)
def test_all_letters_stand_inside_and_apart(draw, size: float) -> None:
    figure = draw(size)
    with plot.style():
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        room = figure.get_tightbbox(canvas.get_renderer())
        width, height = figure.get_size_inches()
        assert min(room.x0, room.y0) >= -0.01
        assert room.x1 <= width + 0.01
        assert room.y1 <= height + 0.01
        for ax in figure.axes:
            for axis in (ax.xaxis, ax.yaxis):
                label = axis.label.get_window_extent()
                shown = [text for text in axis.get_ticklabels() if text.get_text() and text.get_visible()]
                for text in shown if axis.label.get_text() else []:
                    own = text.get_window_extent()
                    assert not label.overlaps(own), (axis.label.get_text(), text.get_text())


def test_a_figure_can_be_written_twice_and_stays_laid_out() -> None:
    figure = new_figure(4.0, 3.0)
    figure.subplots().set_xlabel("time [s]")
    first = plot.svg_text(figure, "a")
    assert figure.get_layout_engine() is not None
    assert plot.svg_text(figure, "a") == first


def test_the_phase_of_a_model_that_is_far_off_is_seen() -> None:
    measured = response(1.0)
    flat = FrequencyResponse(measured.omega, np.full(60, 1.0 + 0.0j), "u", "psi", "rad/input")
    panel = plot.ResponsesPanel("u to psi", flat, {"model": measured})
    (_, bottom) = plot.model_responses([panel], plot.model_styles(["model"])).axes
    low, high = bottom.get_ylim()
    assert low < np.degrees(np.min(measured.phase))
    assert high > 0.0
