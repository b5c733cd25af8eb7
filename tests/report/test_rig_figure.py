"""The report marks in the rig's picture what the verdict names, and paler what its rivals name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from rigsight.diagnose.result import Diagnosis
from rigsight.report.figures import rig_figure, suspected_places
from rigsight.rigs import RIGS


def test_the_place_of_the_verdict_is_marked_with_its_effect(diagnosis: Diagnosis) -> None:
    marks = suspected_places(diagnosis, RIGS["running_gear"])
    assert marks["yaw_dynamics"].strength == 1.0
    assert marks["yaw_dynamics"].label == "Bouc-Wen hysteresis"
    assert set(marks) == {"yaw_dynamics"}
    figure = rig_figure(diagnosis)
    assert figure is not None
    assert "Marked: yaw_dynamics." in figure.caption
    assert "Bouc-Wen hysteresis at yaw_dynamics" in figure.image


def test_a_rival_at_another_place_is_paler(diagnosis: Diagnosis) -> None:
    rival, drowned = diagnosis.candidates[1], diagnosis.candidates[2]
    changed = replace(
        diagnosis,
        rig="drive_train",
        effects=("coulomb_friction@load_bearing",),
        where=("load_bearing",),
        candidates=(
            replace(
                rival, effects=("coulomb_friction@load_bearing",), where=("load_bearing",), probability=0.7
            ),
            replace(
                rival, effects=("coulomb_friction@motor_bearing",), where=("motor_bearing",), probability=0.2
            ),
            replace(
                rival,
                effects=("stribeck_friction@motor_bearing",),
                where=("motor_bearing",),
                probability=0.08,
            ),
            replace(drowned, effects=("sensor_lag@load_angle",), where=("load_angle",), probability=0.02),
        ),
    )
    marks = suspected_places(changed, RIGS["drive_train"])
    assert marks["load_bearing"].label == "Coulomb friction"
    assert marks["motor_bearing"].strength == pytest.approx(0.28)
    assert set(marks) == {"load_bearing", "motor_bearing"}
    figure = rig_figure(changed)
    assert figure is not None
    assert "Paler, also possible: motor_bearing." in figure.caption


@pytest.mark.parametrize(
    ("where", "name", "is_state"),
    [("sensor", "psi", False), ("actuator", "actuator", False), ("lateral_dynamics", "y", True)],
)
def test_an_unknown_cause_is_marked_where_the_evidence_points(
    diagnosis: Diagnosis, where: str, name: str, is_state: bool
) -> None:
    unknown = replace(diagnosis, verdict="unknown", effects=(), where=(where,), candidates=())
    marks = suspected_places(unknown, RIGS["running_gear"])
    assert {key: (mark.label, mark.is_state) for key, mark in marks.items()} == {
        name: ("unexplained", is_state)
    }


def test_a_rig_of_somebody_else_has_no_picture(diagnosis: Diagnosis) -> None:
    assert rig_figure(replace(diagnosis, rig="gantry")) is None


def test_the_picture_stands_behind_the_verdict(
    page_of: Callable[[str], str],
) -> None:
    page = page_of("effect")
    assert page.index('id="verdict"') < page.index('id="figure-rig"') < page.index('id="budget"')
