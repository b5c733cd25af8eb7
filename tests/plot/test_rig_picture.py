"""A rig's picture shows every place of it, and no text stands on another."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest
from matplotlib.transforms import Bbox

from rigsight.plot import PlaceMark, rig_picture, svg_text
from rigsight.plot.rig_content import rig_content
from rigsight.plot.rig_symbols import SUSPECTED
from rigsight.rigs import RIGS, Rig, read_rig_file

FILES = Path(__file__).parents[1] / "rigs" / "files"
ALL = {**{name: name for name in RIGS}, **{path.stem: path for path in FILES.glob("*.toml")}}


def rig_of(name: str) -> Rig:
    return RIGS[name] if name in RIGS else read_rig_file(FILES / f"{name}.toml")


def every_place(rig: Rig) -> list[str]:
    mechanism = rig.mechanism
    return [place.name for place in (*mechanism.joints, *mechanism.drives, *mechanism.sensors)]


@pytest.mark.slow
@pytest.mark.parametrize("marked", [False, True])
@pytest.mark.parametrize("name", ALL)
def test_no_text_stands_on_another_or_beyond_the_edge(name: str, marked: bool) -> None:
    rig = rig_of(name)
    mark = PlaceMark(1.0, "position_dependent_damping")
    figure = rig_picture(rig, dict.fromkeys(every_place(rig), mark) if marked else {})
    renderer = figure.canvas.get_renderer()
    boxes = [
        (text.get_text(), text.get_window_extent(renderer))
        for text in figure.axes[0].texts
        if text.get_text()
    ]
    for (first, a), (second, b) in combinations(boxes, 2):
        assert not _overlap(a, b), (first, second)
    for text, extent in boxes:
        assert figure.bbox.x0 <= extent.x0, text
        assert extent.x1 <= figure.bbox.x1, text
        assert figure.bbox.y0 <= extent.y0, text
        assert extent.y1 <= figure.bbox.y1, text


def _overlap(a: Bbox, b: Bbox) -> bool:
    # Letters hang and rise a pixel or two into the white between lines.
    width = min(a.x1, b.x1) - max(a.x0, b.x0)
    height = min(a.y1, b.y1) - max(a.y0, b.y0)
    return width > 1.0 and height > 3.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ALL)
def test_every_coordinate_joint_drive_and_sensor_is_named(name: str) -> None:
    rig = rig_of(name)
    written = [text.get_text() for text in rig_picture(rig).axes[0].texts]
    for place in (*rig.mechanism.joints, *rig.mechanism.drives):
        assert place.name in written
    for signal in (*rig.mechanism.coordinates, *rig.mechanism.states, *rig.mechanism.sensors):
        assert f"{signal.name} [{signal.unit}]" in written


def test_the_suspected_place_is_marked_with_what_it_is_suspected_of() -> None:
    marks = {"load_bearing": PlaceMark(1.0, "coulomb_friction"), "shaft": PlaceMark(0.1)}
    figure = rig_picture(RIGS["drive_train"], marks)
    label = next(text for text in figure.axes[0].texts if text.get_text() == "coulomb_friction")
    assert label.get_color() == SUSPECTED
    halos = [patch for patch in figure.axes[0].patches if patch.get_alpha() is not None]
    weak, strong = sorted(patch.get_alpha() for patch in halos)
    assert weak < 0.5 * strong
    colored = [line for line in figure.axes[0].lines if line.get_color() == SUSPECTED]
    assert colored


def test_a_mark_tells_a_state_from_the_sensor_that_is_called_the_same() -> None:
    def marked(is_state: bool) -> list[float]:
        figure = rig_picture(RIGS["running_gear"], {"y": PlaceMark(1.0, is_state=is_state)})
        return [patch.get_x() for patch in figure.axes[0].patches if patch.get_alpha() is not None]

    (sensor,), (state,) = marked(False), marked(True)
    assert sensor < state


def test_bodies_stand_in_the_order_in_which_joints_are_short() -> None:
    text = (FILES / "crane.toml").read_text("utf-8")
    assert text.index("coordinates.load") < text.index("coordinates.hook")
    content = rig_content(rig_of("crane"))
    assert [body.name for body in content.bodies] == ["trolley", "hook", "load", "error"]
    assert content.drives[0].sensors == ("position",)


def test_the_same_rig_gives_the_same_picture() -> None:
    first, second = (svg_text(rig_picture(RIGS["servo"]), "rig") for _ in range(2))
    assert first == second
