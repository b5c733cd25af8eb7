"""Names of three effects at their places are longer than a figure is wide."""

from __future__ import annotations

import itertools

from rigsight import plot
from rigsight.diagnose.result import Diagnosis
from rigsight.report.labels import effects_label

THREE = (
    "load_dependent_friction@motor_bearing",
    "bouc_wen_hysteresis@load_bearing",
    "encoder_eccentricity@load_angle",
)


def test_the_ranking_has_room_for_its_bars_beside_long_names(diagnosis: Diagnosis) -> None:
    names = [effects_label(THREE) for _ in diagnosis.candidates]
    assert max(map(len, names)) > 80
    figure = plot.ranking(diagnosis, names)
    (ax,) = figure.axes
    assert ax.get_position().width > 0.4
    figure.canvas.draw()
    boxes = [label.get_window_extent() for label in ax.get_yticklabels()]
    assert min(box.x0 for box in boxes) >= 0.0
    # From the top down none stands on the next.
    assert all(above.y0 >= below.y1 for above, below in itertools.pairwise(boxes))
