"""A disturbance does to the linear rig what it is scaled to do, and more to one whose play lets it choose its place."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.predictability import growth_of_disturbances
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE = 0.01, 1e-5
VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}


def model_of(effects: dict[str, dict[str, float]]) -> tuple[Workbench, Scored]:
    structure = compose(AXIS, [effect_named(name) for name in effects])
    values = {**VALUES, **{name: value for own in effects.values() for name, value in own.items()}}
    t = DT * np.arange(4000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 1.0, 1.0, 40.0)}, {}, role="validation", hold="zoh")
    record = simulate(structure, values, run)
    scales = characteristic_scales(AXIS, [record], VALUES)
    noise = {"x": NOISE}
    bench = Workbench(AXIS, (record,), (record,), (record,), scales, noise, frozenset())
    fit = GreyBoxFit(structure, [record], scales, noise).fit(values, [])
    return bench, Scored(structure.effects, fit, fit, fit.weighted_rms)


def growth(effects: dict[str, dict[str, float]]) -> float:
    bench, model = model_of(effects)
    _, linear = model_of({})
    return growth_of_disturbances(bench, linear, model, np.random.default_rng(0))


def test_the_linear_rig_moves_by_the_noise() -> None:
    assert growth({}) == pytest.approx(1.0, rel=1e-6)


def test_a_stiffer_spring_is_no_less_predictable() -> None:
    assert growth({"cubic_stiffness": {"k_3": 1e5}}) < 2.0


def test_play_lets_a_disturbance_choose_another_motion() -> None:
    assert growth({"backlash": {"g": 5e-3}}) > 3.0
