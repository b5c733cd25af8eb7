"""A fit that was remembered serves again for the very same problem alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}


class Kept:
    def __init__(self) -> None:
        self.known: dict[str, Mapping[str, Any]] = {}
        self.recalled = 0

    def recall(self, key: str) -> Mapping[str, Any] | None:
        self.recalled += key in self.known
        return self.known.get(key)

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        self.known[key] = outcome


def fit_of(rig: Rig, memory: Kept) -> GreyBoxFit:
    push = Record("push", 0.01, {"u": np.sin(np.linspace(0.0, 60.0, 300) ** 1.3)}, {})
    record = simulate(compose(rig), VALUES, push)
    scales = characteristic_scales(rig, [record], VALUES)
    return GreyBoxFit(compose(rig), [record], scales, {"x": 1e-5}, memory=memory)


def test_a_rig_file_with_other_bounds_is_another_problem() -> None:
    text = rig_file_text("axis").replace('name = "axis"', 'name = "stage"')
    other = text.replace(
        '[parameters.m]\nunit = "kg"\nlower = 1e-15', '[parameters.m]\nunit = "kg"\nlower = 1e-3'
    )
    assert other != text
    memory = Kept()
    for rig, recalled in ((rig_of_text(text), 0), (rig_of_text(text), 1), (rig_of_text(other), 1)):
        fit = fit_of(rig, memory)
        fit.fit({**VALUES, "m": 2.2}, ["m"])
        assert memory.recalled == recalled


def test_a_rough_fit_does_not_serve_for_one_that_is_finished() -> None:
    memory = Kept()
    fit = fit_of(AXIS, memory)
    for finish, recalled in ((False, 0), (True, 0), (False, 1), (True, 2)):
        fit.fit({**VALUES, "m": 2.2}, ["m"], finish=finish)
        assert memory.recalled == recalled


def test_the_rounding_of_an_initial_state_makes_no_other_problem() -> None:
    memory = Kept()
    fit = fit_of(AXIS, memory)
    for speed, recalled in ((0.0, 0), (1e-19, 1), (1e-3, 1)):
        fit.fit({**VALUES, "m": 2.2}, ["m"], initial_states=[np.array([0.0, speed])])
        assert memory.recalled == recalled
