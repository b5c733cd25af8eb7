"""A fit of the free run takes the initial state from the first samples alone, and only the parameters from the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigsight.effects import Effect, effect_named
from rigsight.errors import InputError
from rigsight.excitation import linear_sweep
from rigsight.identify import FitResult, GreyBoxFit, characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

DT, NOISE, FIRST = 0.01, 1e-5, 20
TRUTH = {"gain": 1.0, "m": 2.0, "d": 5.0, "k": 0.0, "x_off": 0.0, "force_off": 0.1}
FREE = ("m", "d", "force_off")


def record(effects: Sequence[Effect] = (), seed: int = 0, **numbers: float) -> Record:
    """Return a mass without a spring that a sweep drives; it drifts."""
    rng = np.random.default_rng(seed)
    t = DT * np.arange(1500)
    run = Record("run", DT, {"u": linear_sweep(t, 10.0, 0.5, 6.0)}, {}, hold="zoh")
    clean = simulate(compose(AXIS, effects), {**TRUTH, **numbers}, run)
    return clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size))


def fitted(
    records: Sequence[Record], free: Sequence[str], effects: Sequence[Effect] = (), **start: float
) -> FitResult:
    values = {**TRUTH, **start}
    scales = characteristic_scales(AXIS, records, values)
    return GreyBoxFit(compose(AXIS, effects), records, scales, {"x": NOISE}).fit(values, free)


def run_free(measured: Record) -> Record:
    return replace(measured, starting_samples=FIRST)


def test_later_samples_do_not_move_the_initial_state() -> None:
    whole = record()
    later = whole["x"] + np.where(np.arange(whole.n_samples) < FIRST, 0.0, 1e-2)
    states = [fitted([run_free(r)], ()).initial_states[0] for r in (whole, whole.with_signals(x=later))]
    assert np.allclose(*states, rtol=1e-9)
    assert np.allclose(states[0], fitted([whole.slice(0, FIRST)], ()).initial_states[0], rtol=1e-9)
    assert not np.allclose(states[0], fitted([whole.with_signals(x=later)], ()).initial_states[0], atol=1e-4)


@pytest.mark.parametrize("effects", [(), (effect_named("coulomb_friction"),)])
def test_the_numbers_of_records_that_drift_are_found(effects: tuple[Effect, ...]) -> None:
    friction = {"T_c": 0.8} if effects else {}
    records = [run_free(record(effects, seed, **friction)) for seed in (1, 2)]
    free = (*FREE, *friction)
    fit = fitted(records, free, effects, m=3.0, d=4.0, force_off=0.0, **dict.fromkeys(friction, 0.5))
    assert fit.success, fit.message
    for name in free:
        error = abs(fit.values[name] - {**TRUTH, **friction}[name])
        assert error < 0.02 * {**TRUTH, **friction}[name], name


def test_the_free_run_is_better_than_that_of_fitted_states() -> None:
    """A law that is missing is taken up by the parameters, not by a velocity at the start that no sample shows."""
    measured = record((effect_named("quadratic_damping"),), c_2=4.0)
    values = [fitted([r], FREE).values for r in (measured, run_free(measured))]
    usual, own = (fitted([run_free(measured)], (), **{n: v[n] for n in FREE}).cost for v in values)
    assert own < 0.9 * usual


@pytest.mark.parametrize("position", [-0.02, 0.02])
@pytest.mark.parametrize("velocity", [-0.5, 0.5])
def test_a_sensor_of_magnitudes_shows_where_a_motion_begins(position: float, velocity: float) -> None:
    """A push tells the direction; where the motion crosses zero at once, the reading does not begin with its slope."""
    values = {**TRUTH, "k": 300.0, "r": 1.0}
    structure = compose(AXIS, [effect_named("rectified_sensor")])
    push = Record("push", DT, {"u": np.full(400, 3.0)}, {}, hold="zoh")
    run = simulate(structure, values, push, np.array([position, velocity]))
    seen = run.with_signals(x=run["x"] + np.random.default_rng(0).normal(scale=NOISE, size=400))
    scales = characteristic_scales(AXIS, [seen], values)
    fit = GreyBoxFit(structure, [seen], scales, {"x": NOISE}).fit(values, ())
    assert np.allclose(fit.initial_states[0], [position, velocity], atol=1e-3)


def test_records_with_and_without_are_not_mixed() -> None:
    with pytest.raises(InputError):
        fitted([record(), run_free(record())], FREE)
