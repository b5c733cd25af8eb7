"""Figures of many models: everyone is named once, the best is seen, a failed one is said to have failed."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.frequency import FrequencyResponse
from rigsight.plot import (
    ErrorPanel,
    ResponsesPanel,
    StepPanel,
    model_errors,
    model_responses,
    model_steps,
    model_styles,
    svg_text,
)


def response(turns: float = 0.0) -> FrequencyResponse:
    omega = np.linspace(1.0, 20.0, 60)
    values = np.exp(1j * (2.0 * np.pi * turns - 0.1 * omega)) / (100.0 - omega**2 + 2j * omega)
    return FrequencyResponse(omega, values, "u", "psi", "rad/A", variance=np.full(60, 1e-8))


def test_each_model_is_named_once_and_drawn_over_every_path() -> None:
    names = ["nominal", "mine"]
    panel = ResponsesPanel("u to psi", response(), dict.fromkeys(names, response()))
    figure = model_responses([panel, panel], model_styles(names))
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["measured, 95 % band", *names]
    assert all(len(ax.lines) == 3 for ax in figure.axes)


def test_a_whole_turn_of_phase_is_no_difference() -> None:
    panel = ResponsesPanel("u to psi", response(), {"mine": response(turns=1.0)})
    measured, own = model_responses([panel], model_styles(["mine"])).axes[1].lines
    np.testing.assert_allclose(own.get_ydata(), measured.get_ydata(), atol=1e-6)


def test_twenty_models_have_twenty_styles() -> None:
    styles = model_styles([str(i) for i in range(20)])
    assert len({(style["color"], str(style["linestyle"])) for style in styles.values()}) == 20


def test_a_step_is_limited_by_what_was_measured() -> None:
    t = np.linspace(0.0, 4.0, 100)
    panel = StepPanel("psi", "rad", t, 0.01 * (1.0 - np.exp(-t)), {"far": 5.0 * t})
    (ax,) = model_steps([panel], model_styles(["far"])).axes
    assert ax.get_ylabel() == "change of psi [mrad]"
    assert ax.get_ylim()[1] < 20.0


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_the_best_is_blue_and_a_failed_model_is_said_to_have_failed(scale: float) -> None:
    overall = {"good": 2.1 * scale, "bad": 6.0 * scale}
    single = {"good": [2.0 * scale, 2.2 * scale], "bad": [6.0 * scale], "gone": []}
    panel = ErrorPanel("psi, step [rad]", overall, single, frozenset({"good"}), 1.9 * scale)
    figure = model_errors([panel], ["good", "bad", "gone"])
    (ax,) = figure.axes
    good, bad = (bar.get_facecolor() for bar in ax.patches)
    assert good != bad
    assert [text.get_text() for text in ax.texts] == ["failed"]
    # Axes of less than two decades are labeled too.
    assert len(ax.get_xticklabels()) >= 2
    assert "mathdefault" not in svg_text(figure, "errors")
