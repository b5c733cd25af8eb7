"""A candidate gets a fair first look, whatever the fit without it has made of the other numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.search.first_look import FirstLook, look_at, mean_square, widened
from rigsight.effects import effect_named
from rigsight.excitation import linear_sweep
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE = 0.01, 1e-5
CUBIC, HYSTERESIS = effect_named("cubic_stiffness"), effect_named("bouc_wen_hysteresis")
GIVEN = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0, "k_3": 1e4}
LOOP = {"A": 1.0, "n": 1.0, "a": 0.5, "beta": 200.0, "gamma": 200.0, "k": 150.0}


def test_where_a_refit_is_bent_beyond_use_the_values_before_it_are_the_start() -> None:
    t = DT * np.arange(3000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 2.0, 1.0, 40.0)}, {}, role="estimation", hold="zoh")
    record = simulate(compose(AXIS, [CUBIC, HYSTERESIS]), {**GIVEN, **LOOP}, run)
    scales = characteristic_scales(AXIS, [record], GIVEN)
    modelled = compose(AXIS, [CUBIC])
    refit = GreyBoxFit(modelled, [record], scales, {"x": NOISE}).fit(GIVEN, [])
    bent = replace(refit, values={**refit.values, "k": 1.0, "k_3": -1e9})
    context = FitContext(
        AXIS, (record,), (record,), (record,), scales, {"x": NOISE}, frozenset(), modelled=(CUBIC,)
    )
    assert not np.isfinite(look_at(context, (HYSTERESIS,), bent, {}).cost)
    rescued = look_at(replace(context, start=GIVEN), (HYSTERESIS,), bent, {})
    assert rescued.cost < 0.01 * refit.cost


def test_a_lag_too_short_for_the_steps_of_another_model_takes_its_own() -> None:
    lag, short = effect_named("actuator_lag"), 0.12 * DT
    t = DT * np.arange(2000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 2.0, 1.0, 40.0)}, {}, role="estimation", hold="zoh")
    own = {name: value for name, value in GIVEN.items() if name != "k_3"}
    record = simulate(compose(AXIS, [lag]), {**own, "T_a": short}, run)
    scales = characteristic_scales(AXIS, [record], own)
    context = FitContext(AXIS, (record,), (record,), (record,), scales, {"x": NOISE}, frozenset())
    structure = context.composed((lag,))
    start = context.problem(structure, (record,)).fit({**own, "T_a": short}, [])
    assert max(start.substeps) > 1
    look = FirstLook((lag,), structure, tuple(context.free_parameters(structure)), (start,), 1.0)
    assert not np.isfinite(context.problem(structure, (record,)).fit(start.values, [], substeps=[1]).cost)
    (wide,) = widened(context, [look], substeps=[1])
    assert mean_square(wide.fits[0]) < 1.0


def test_where_a_sensor_loses_the_sign_the_given_simulation_is_a_start() -> None:
    rectified = effect_named("rectified_sensor")
    t = DT * np.arange(2000)
    run = Record("sweep", DT, {"u": linear_sweep(t, 2.0, 1.0, 40.0)}, {}, role="estimation", hold="zoh")
    own = {name: value for name, value in GIVEN.items() if name != "k_3"}
    record = simulate(compose(AXIS, [rectified]), {**own, "r": 1.0}, run)
    scales = characteristic_scales(AXIS, [record], own)
    refit = GreyBoxFit(compose(AXIS), [record], scales, {"x": NOISE}).fit(own, [])
    bent = replace(refit, values={**refit.values, "m": 600.0, "d": 0.1})
    context = FitContext(
        AXIS, (record,), (record,), (record,), scales, {"x": NOISE}, frozenset(), given={**own, "m": 1.1}
    )
    look = look_at(context, (rectified,), bent, {})
    assert mean_square(look.fits[0]) < 1.0
    assert look.fits[0].values["r"] > 0.99
