"""Schematic of a rig: signals on the left, bodies in the middle, joints to the ground on the right."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rigsight.plot import rig_symbols as symbols
from rigsight.plot.drawing import new_figure, style, text_width
from rigsight.plot.rig_content import Body, Place, RigContent, rig_content
from rigsight.plot.rig_symbols import FAINT, INK, SUSPECTED, TEXT, block_size, write_block
from rigsight.rigs import Rig

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARGIN = 0.12
_LANE = 0.13
"""Between lines side by side."""
_BETWEEN = 0.12
"""Between blocks on top of each other."""
_JOINT_LENGTH = 0.75
"""Of a joint to the ground, with its ends."""
_JOINT_HEIGHT = 0.36
"""Of a joint to the ground, without its text."""
_LONG_LANE = 0.25
"""From the text of one joint around other bodies to the next such joint."""
_NARROWEST = 5.4
"""Of the picture, so that letters have one size on a page, whatever the rig."""
_GAP, _GAP_COUPLED, _GAP_JOINT = 0.2, 0.34, 0.7
"""Between two bodies with nothing, a coupling or a joint between them."""
_FILLS = {"free": "#e6eef5", "prescribed": "#f4f4f2", "state": "#f3eef8"}
_NOTCH = 0.06
"""Of a sensor's flag, where nothing is written."""
_SURE = 0.5
"""Strength from which a suspected place is drawn in the color itself."""


@dataclass(frozen=True)
class PlaceMark:
    """A suspected place."""

    strength: float  # from 0 to 1
    label: str = ""  # what it is suspected of
    is_state: bool = False  # true for a state, which may be called as a sensor is


@style()
def rig_picture(rig: Rig, marks: Mapping[str, PlaceMark] | None = None) -> Figure:
    """Return a schematic of a rig."""
    return _Sheet(rig_content(rig), marks or {}).figure()


class _Sheet:
    """Sizes first, then places from top to bottom, then lines."""

    def __init__(self, content: RigContent, marks: Mapping[str, PlaceMark]) -> None:
        self._content = content
        self._marks = marks
        rows, joints, left = range(len(content.bodies)), content.joints, (*content.drives, *content.sensors)
        self._of_row = {row: [p for p in left if (p.bodies or (0,))[0] == row] for row in rows}
        self._grounded = {row: [j for j in joints if j.grounded and j.bodies == (row,)] for row in rows}
        self._between = {row: [j for j in joints if not j.grounded and j.bodies[0] == row] for row in rows}
        self._place_columns()
        self._place_rows()

    def _mark(self, place: Place | Body) -> PlaceMark | None:
        mark = self._marks.get(place.name)
        is_state = isinstance(place, Body)
        return mark if mark is not None and mark.is_state == is_state else None

    def _label(self, place: Place | Body) -> str | None:
        mark = self._mark(place)
        return mark.label if mark is not None and mark.label else None

    def _size(self, place: Place | Body) -> tuple[float, float]:
        width, height = block_size(place.title, place.lines, self._label(place))
        return width + _NOTCH * (place in self._content.sensors), height

    def _place_columns(self) -> None:
        content = self._content
        left = [*content.drives, *content.sensors]
        inputs = {name for drive in content.drives for name in drive.inputs}
        loops = sum(len(drive.sensors) for drive in content.drives)
        prescribing = [body.input for body in content.bodies if body.input is not None]
        lanes = sum(len(place.bodies) > 1 for place in left) + sum(bool(b.reads) for b in content.bodies)
        labels = text_width(inputs, TEXT) + 0.05 if inputs else 0.0
        self._input_right = _MARGIN + labels
        self._left = self._input_right + (0.3 if inputs or loops else 0.0) + _LANE * loops
        width = max([self._size(place)[0] for place in left], default=0.0)
        width = max(width, text_width(prescribing, TEXT) + 0.4 if prescribing else 0.0)
        self._left_end = self._left + width
        self._body = self._left_end + 0.36 + _LANE * lanes
        body_width = max(self._size(body)[0] for body in content.bodies)
        between = [
            0.24 + sum(0.3 + self._size(joint)[0] for joint in joints if len(joint.bodies) == 2 and joint.bodies[1] == row + 1)
            for row, joints in self._between.items()
        ]  # fmt: skip
        self._body_end = self._body + max(1.1, body_width, *between)
        joints = [joint for own in self._between.values() for joint in own]
        self._long = [j for j in joints if j.bodies[-1] - j.bodies[0] > 1 or len(j.bodies) > 2]
        self._lanes: list[float] = []
        self._lane_end = self._body_end
        for joint in self._long:
            self._lanes.append(self._lane_end + _LONG_LANE)
            self._lane_end += _LONG_LANE + 0.14 + self._size(joint)[0]
        grounded = [joint for joints in self._grounded.values() for joint in joints]
        self._wall = (
            self._lane_end + max([_JOINT_LENGTH, *(self._size(joint)[0] for joint in grounded)]) + 0.1
        )
        self._width = (self._wall + 0.1 if grounded else self._lane_end) + _MARGIN

    def _place_rows(self) -> None:
        content = self._content
        self._top: dict[int, float] = {}
        self._bottom: dict[int, float] = {}
        y = -_MARGIN
        for row, body in enumerate(content.bodies):
            left = [self._size(place)[1] for place in self._of_row[row]]
            left += [0.2] if body.input is not None else []
            right = [self._size(joint)[1] + _JOINT_HEIGHT - symbols.PAD for joint in self._grounded[row]]
            stacks = [sum(own) + _BETWEEN * max(0, len(own) - 1) for own in (left, right)]
            self._top[row] = y
            y -= max(self._size(body)[1], *stacks)
            self._bottom[row] = y
            joined = [self._size(joint)[1] for joint in self._between[row]]
            coupled = any(pair[0] == row for pair in content.couplings)
            if row + 1 < len(content.bodies):
                y -= max([_GAP, _GAP_COUPLED * coupled, *(max(_GAP_JOINT, h) for h in joined)])
        self._height = -y + _MARGIN
        self._top = {row: value + self._height for row, value in self._top.items()}
        self._bottom = {row: value + self._height for row, value in self._bottom.items()}

    def figure(self) -> Figure:
        margin = max(0.0, (_NARROWEST - self._width) / 2.0)
        figure = new_figure(self._width + 2.0 * margin, self._height, layout=None)
        self._ax = ax = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        ax.set_axis_off()
        ax.set_xlim(-margin, self._width + margin)
        ax.set_ylim(0.0, self._height)
        self._draw_couplings()
        for row, body in enumerate(self._content.bodies):
            self._draw_body(row, body)
            self._draw_grounded(row)
            self._draw_between(row)
        if held := [row for row, joints in self._grounded.items() if joints]:
            symbols.wall(self._ax, self._wall, self._bottom[held[-1]], self._top[held[0]])
        self._draw_left()
        return figure

    def _color(self, place: Place) -> str:
        mark = self._mark(place)
        return SUSPECTED if mark is not None and mark.strength >= _SURE else INK

    def _draw_joint(self, joint: Place, start: symbols.Point, end: symbols.Point) -> None:
        symbols.joint(self._ax, start, end, joint.spring, joint.damper, self._color(joint))

    def _write(self, place: Place | Body, left: float, middle: float) -> None:
        write_block(self._ax, left, middle, place.title, place.lines, self._label(place))

    def _draw_halo(self, place: Place | Body, corner: symbols.Point, size: symbols.Point) -> None:
        mark = self._mark(place)
        if mark is not None:
            symbols.halo(self._ax, corner, size, mark.strength)

    def _draw_body(self, row: int, body: Body) -> None:
        corner = (self._body, self._bottom[row])
        size = (self._body_end - self._body, self._top[row] - self._bottom[row])
        self._draw_halo(body, corner, size)
        dashed: dict[str, Any] = {"linestyle": (0, (4, 2))} if body.kind == "prescribed" else {}
        symbols.box(self._ax, corner, size, _FILLS[body.kind], linewidth=1.0, **dashed)
        self._write(body, self._body + symbols.PAD, (self._top[row] + self._bottom[row]) / 2.0)

    def _draw_couplings(self) -> None:
        for upper, lower, what in self._content.couplings:
            x = self._body + 0.14
            ends = (self._bottom[upper], self._top[lower])
            self._ax.plot([x, x], ends, color="#aebccb", linewidth=5.0, solid_capstyle="butt")
            if not self._between[upper]:
                symbols.write(self._ax, x + 0.1, sum(ends) / 2.0, what, FAINT, style="italic")

    def _draw_grounded(self, row: int) -> None:
        joints = self._grounded[row]
        heights = [self._size(joint)[1] + _JOINT_HEIGHT - symbols.PAD for joint in joints]
        used = sum(heights) + _BETWEEN * max(0, len(joints) - 1)
        y = (self._top[row] + self._bottom[row] + used) / 2.0
        for joint, height in zip(joints, heights, strict=True):
            text = height - _JOINT_HEIGHT
            left = self._lane_end + 0.1
            self._draw_halo(
                joint, (left - 0.02, y - height + 0.02), (self._wall - left - 0.06, height - 0.04)
            )
            self._write(joint, left, y - text / 2.0 - symbols.PAD / 4.0)
            level = y - text - _JOINT_HEIGHT / 2.0
            color = self._color(joint)
            self._ax.plot([self._body_end, self._lane_end], [level, level], color=color, linewidth=1.2)
            self._draw_joint(joint, (self._lane_end, level), (self._wall, level))
            y -= height + _BETWEEN

    def _draw_between(self, row: int) -> None:
        x = self._body + 0.38
        for joint in self._between[row]:
            middle = (self._bottom[row] + self._top[row + 1]) / 2.0
            width, height = self._size(joint)
            if joint in self._long:
                lane = self._lanes[self._long.index(joint)]
                self._draw_halo(joint, (lane - 0.12, middle - 0.3), (width + 0.3, 0.6))
                self._draw_long(joint, lane)
                self._write(joint, lane + 0.2, middle)
                continue
            self._draw_halo(joint, (x - 0.14, middle - height / 2.0 + 0.03), (width + 0.2, height - 0.06))
            self._draw_joint(joint, (x, self._bottom[row]), (x, self._top[row + 1]))
            self._write(joint, x + 0.2, middle)
            x += width + 0.3

    def _draw_long(self, joint: Place, lane: float) -> None:
        first, last = joint.bodies[0], joint.bodies[-1]
        look: dict[str, Any] = {"color": self._color(joint), "linewidth": 1.2}
        offset = _LANE * (self._long.index(joint) + 0.6)
        start, stop = self._bottom[first] + offset, self._top[last] - offset
        self._draw_joint(joint, (lane, self._bottom[first]), (lane, self._top[first + 1]))
        self._ax.plot([self._body_end, lane, lane], [start, start, self._bottom[first]], **look)
        self._ax.plot([lane, lane, self._body_end], [self._top[first + 1], stop, stop], **look)
        for row in joint.bodies[1:-1]:
            level = self._top[row] - offset
            self._ax.plot([self._body_end, lane], [level, level], marker="o", markersize=2.5, **look)

    def _draw_left(self) -> None:
        middles: dict[str, float] = {}
        lane = self._body - 0.2
        drives = {drive.name for drive in self._content.drives}
        for row, body in enumerate(self._content.bodies):
            places = self._of_row[row]
            heights = [self._size(place)[1] for place in places]
            extra = 0.2 + _BETWEEN if body.input is not None else 0.0
            used = (
                sum(heights) + _BETWEEN * max(0, len(places) - 1) + (extra if places else 0.2 * bool(extra))
            )
            y = (self._top[row] + self._bottom[row] + used) / 2.0
            if body.input is not None:
                symbols.write(self._ax, self._left_end - 0.3, y - 0.1, body.input, ha="right")
                symbols.arrow(self._ax, [(self._left_end - 0.24, y - 0.1), (self._body, y - 0.1)], INK)
                y -= 0.2 + _BETWEEN
            for place, height in zip(places, heights, strict=True):
                middles[place.name] = y - height / 2.0
                if len(place.bodies) > 1:
                    lane -= _LANE
                self._draw_place(place, y, height, lane, place.name in drives)
                y -= height + _BETWEEN
            if body.reads:
                lane -= _LANE
                self._draw_reading_state(row, body, lane)
        self._draw_signals(middles)

    def _draw_reading_state(self, row: int, body: Body, lane: float) -> None:
        """Draw which bodies the rate of a state reads."""
        level = self._top[row] - 0.07
        for read in body.reads:
            start = self._bottom[read] + 0.07
            self._ax.plot([self._body, lane, lane], [start, start, level], color=FAINT, linewidth=0.8)
            self._ax.plot(self._body, start, marker="o", markersize=3.0, color=FAINT)
        symbols.arrow(self._ax, [(lane, level), (self._body, level)], FAINT, width=0.8)

    def _draw_place(self, place: Place, top: float, height: float, lane: float, is_drive: bool) -> None:
        corner, size = (self._left, top - height), (self._left_end - self._left, height)
        self._draw_halo(place, corner, size)
        color, middle = self._color(place), top - height / 2.0
        if is_drive:
            symbols.box(self._ax, corner, size, "#fdf3e3", color, linewidth=1.0)
        else:
            symbols.flag(self._ax, corner, size, color)
        self._write(place, self._left + symbols.PAD + _NOTCH * (not is_drive), middle)
        first, *others = place.bodies or (0,)
        level = min(max(middle, self._bottom[first] + 0.05), self._top[first] - 0.05)
        ends = [(self._body, level)]
        ends += [(self._body, self._top[row] - 0.07 - 0.05 * (not is_drive)) for row in others]
        for index, end in enumerate(ends):
            way = [(self._left_end, middle), end] if index == 0 else [(lane, middle), (lane, end[1]), end]
            if is_drive:
                symbols.arrow(self._ax, way, color, width=1.8)
            else:
                self._ax.plot([x for x, _ in way], [y for _, y in way], color=FAINT, linewidth=0.8)
                self._ax.plot(*end, marker="o", markersize=3.0, color=FAINT)

    def _draw_signals(self, middles: Mapping[str, float]) -> None:
        lane = self._left - 0.2
        for drive in self._content.drives:
            count, middle = len(drive.inputs) + len(drive.sensors), middles[drive.name]
            slots = [middle + 0.14 * ((count - 1) / 2.0 - index) for index in range(count)]
            for name, level in zip(drive.inputs, slots, strict=False):
                symbols.write(self._ax, self._input_right, level, name, ha="right")
                symbols.arrow(self._ax, [(self._input_right + 0.05, level), (self._left, level)], INK)
            for name, level in zip(drive.sensors, slots[len(drive.inputs) :], strict=True):
                way = [(self._left, middles[name]), (lane, middles[name]), (lane, level), (self._left, level)]
                symbols.arrow(self._ax, way, FAINT, dashed=True)
                lane -= _LANE
