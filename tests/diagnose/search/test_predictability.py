"""A disturbance does to the linear rig what it is scaled to do, and more to one whose play lets it choose its place."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.horizon import growth_of_disturbances
from rigsight.effects import effect_named, placed
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS, Rig
from rigsight.simulate import compose, simulate

DT, NOISE = 0.01, 1e-5
VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}


def model_of(effects: dict[str, dict[str, float]]) -> tuple[FitContext, FittedModel]:
    structure = compose(AXIS, [effect_named(name) for name in effects])
    values = {**VALUES, **{name: value for own in effects.values() for name, value in own.items()}}
    t = DT * np.arange(4000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 1.0, 1.0, 40.0)}, {}, role="validation", hold="zoh")
    record = simulate(structure, values, run)
    scales = characteristic_scales(AXIS, [record], VALUES)
    noise = {"x": NOISE}
    context = FitContext(AXIS, (record,), (record,), (record,), scales, noise, frozenset())
    fit = GreyBoxFit(structure, [record], scales, noise).fit(values, [])
    return context, FittedModel(structure.effects, fit, fit, fit.weighted_rms)


def growth(effects: dict[str, dict[str, float]]) -> float:
    context, model = model_of(effects)
    _, reidentified = model_of({})
    return growth_of_disturbances(context, reidentified, model, np.random.default_rng(0))


def test_the_linear_rig_moves_by_the_noise() -> None:
    assert growth({}) == pytest.approx(1.0, rel=1e-6)


def test_a_stiffer_spring_is_no_less_predictable() -> None:
    assert growth({"cubic_stiffness": {"k_3": 1e5}}) < 2.0


def test_play_lets_a_disturbance_choose_another_motion() -> None:
    assert growth({"backlash": {"g": 5e-3}}) > 3.0


@pytest.mark.slow
def test_each_input_is_disturbed_and_each_sensor_looked_at(two_masses: Rig) -> None:
    """Nothing ties the masses together: only the second motor reaches the play, and only the second sensor shows it."""
    values = {"m": 1.0, "k": 40.0, "c": 0.0, "d": 1.0}
    noise = {"first_place": 1e-5, "second_place": 1e-5}
    t = DT * np.arange(4000)
    drives = {"f_1": linear_sweep(t, 1.0, 1.0, 20.0), "f_2": linear_sweep(t, 1.0, 2.0, 25.0)}
    play = placed(effect_named("backlash"), "second")
    models = []
    for effects, own in (([], {}), ([play], {"g": 0.01})):
        structure = compose(two_masses, effects)
        record = simulate(structure, values | own, Record("sweep", DT, drives, {}, hold="zoh"))
        scales = characteristic_scales(two_masses, [record], values)
        context = FitContext(two_masses, (record,), (record,), (record,), scales, noise, frozenset())
        fit = GreyBoxFit(structure, [record], scales, noise).fit(values | own, [])
        models.append(FittedModel(structure.effects, fit, fit, fit.weighted_rms))
    reidentified, with_play = models
    rng = np.random.default_rng(0)
    assert growth_of_disturbances(context, reidentified, reidentified, rng) == pytest.approx(1.0, rel=1e-6)
    assert growth_of_disturbances(context, reidentified, with_play, rng) > 3.0
