"""A static drawing: every point in its place, gaps where there are no numbers, names as text."""

from __future__ import annotations

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rigsight.report.drawing.line_drawing import Area, DrawnPanel, Line, around, line_drawing

X = np.linspace(2.0, 4.0, 21)


def drawn(*lines: Line, log: bool = False, limits: tuple[float, float] = (0.0, 10.0), **more: object) -> str:
    panel = DrawnPanel("error [mrad]", 1, limits, lines, more.pop("areas", ()))  # type: ignore[arg-type]
    return str(line_drawing([panel], "time [s]", "key", "what it shows", (6.0, 4.0), log=log, **more))  # type: ignore[arg-type]


def places(text: str, color: str) -> list[np.ndarray]:
    """The points of each unbroken part of the line of a color."""
    (path,) = re.findall(rf'<path d="([^"]+)" stroke="{color}"', text)
    return [
        np.array(re.findall(r"-?[\d.]+", part), dtype=float).reshape(-1, 2) for part in path.split("M")[1:]
    ]


def frame(text: str) -> tuple[float, float, float, float]:
    """Left, top, width and height of the panel."""
    found = re.search(
        r'<clipPath id="[^"]+"><rect x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', text
    )
    assert found is not None
    left, top, width, height = map(float, found.groups())
    return left, top, width, height


def test_points_stand_where_their_values_are() -> None:
    text = drawn(Line(X, (X - 2.0) ** 2, "#0072b2"))
    left, top, width, height = frame(text)
    (line,) = places(text, "#0072b2")
    assert line[:, 0] == pytest.approx(left + width * (X - 2.0) / 2.0, abs=0.06)
    assert line[:, 1] == pytest.approx(top + height * (1.0 - (X - 2.0) ** 2 / 10.0), abs=0.06)


def test_decades_are_as_far_apart_as_each_other() -> None:
    omega = np.array([1.0, 100.0, 10_000.0])
    text = drawn(Line(omega, omega / 2e3, "#0072b2"), log=True)
    (line,) = places(text, "#0072b2")
    assert np.diff(line[:, 0]) == pytest.approx([np.ptp(line[:, 0]) / 2.0] * 2, abs=0.11)
    assert re.findall(r'text-anchor="middle">([\d.]+)<', text)[:4] == ["1", "10", "100", "1000"]


def test_what_is_not_finite_leaves_a_gap() -> None:
    values = np.where((X > 2.55) & (X < 2.75), np.nan, 1.0)
    first, last = places(drawn(Line(X, values, "#0072b2")), "#0072b2")
    assert len(first) + len(last) == np.count_nonzero(np.isfinite(values))
    nothing = drawn(Line(X, np.full(X.size, np.nan), "#0072b2"))
    assert "#0072b2" not in nothing


def test_names_are_text_and_the_drawing_is_sound() -> None:
    lines = [
        Line(X, X, color, label=name)
        for color, name in (("#0072b2", "a < b & c"), ("#d55e00", "x" * 90), ("#5f6770", "last"))
    ]
    text = drawn(
        *lines, areas=(Area(X, X - 1.0, X + 1.0, "#1d2126", 0.2),), marked=(2.5, 3.0), title="<title>"
    )
    root = ET.fromstring(text)
    assert [element.text for element in root.iter("text")][:3] == ["a < b & c", "x" * 90, "last"]
    # A name that is too long for the row begins another one, and the panel makes room.
    heights = [float(element.attrib["y"]) for element in root.iter("text")][:3]
    assert heights[0] < heights[1] < heights[2] < frame(text)[1]
    assert "<title>" not in text
    assert root.attrib["aria-label"] == "what it shows"


def test_ticks_are_round_numbers_inside_the_panel() -> None:
    text = drawn(Line(X, X, "#0072b2"), limits=(-0.013, 0.0171))
    labels = re.findall(r'text-anchor="end">([^<]+)<', text)
    assert labels == ["\u22120.010", "\u22120.005", "0.000", "0.005", "0.010", "0.015"]


@pytest.mark.parametrize("limits", [(0.0, 0.0), (-1e-320, 1e-320), (np.nan, np.nan)])
def test_no_values_break_no_drawing(limits: tuple[float, float]) -> None:
    ET.fromstring(drawn(Line(X, np.zeros(X.size), "#0072b2"), limits=limits))
    ET.fromstring(drawn())


def test_limits_hold_all_that_is_finite_within_a_cap() -> None:
    low, high = around([np.array([1.0, np.nan, 3.0]), np.array([np.inf, 2.0])])
    assert -0.5 < low - 1.0 < 0.0 < high - 3.0 < 0.5
    assert around([np.array([0.0, 1e9])], (-1.0, 1.0))[1] < 1.2
    assert around([np.array([np.nan])]) == (-1.0, 1.0)
