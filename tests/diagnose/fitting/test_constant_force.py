"""Friction that differs each way is told from a constant force only where the constant forces are known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FitContext, known_constant_forces
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.effects import Effect, effect_named
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import RIGS
from rigsight.simulate import compose, simulate

AXIS = RIGS["axis"]
LOPSIDED, EVEN = effect_named("directional_friction"), effect_named("coulomb_friction")
VALUES = {"gain": 1.0, "m": 1.0, "d": 4.0, "k": 0.0, "x_off": 0.0, "force_off": 0.0}
NOISE = 1e-3


def test_a_rest_position_is_known_only_where_it_is_given() -> None:
    assert known_constant_forces(AXIS, EVEN, {}, has_stiffness=True) == {}
    assert known_constant_forces(AXIS, LOPSIDED, {}, has_stiffness=True) is None
    assert known_constant_forces(AXIS, LOPSIDED, {"x_off": 0.1}, has_stiffness=True) == {
        "x_off": 0.1,
        "force_off": 0.0,
    }
    assert known_constant_forces(AXIS, LOPSIDED, {"force_off": 2.0}, has_stiffness=False)["force_off"] == 2.0
    shaft = effect_named("directional_friction@shaft")
    assert known_constant_forces(RIGS["drive_train"], shaft, {}, has_stiffness=True) == {}


def bench_of(effect: Effect, values: Mapping[str, float], given: Mapping[str, float]) -> FitContext:
    """Two runs of many tones."""
    rng, structure = np.random.default_rng(5), compose(AXIS, [effect])
    t, records = 0.01 * np.arange(800), []
    for number in range(2):
        waves = [np.cos(2.0 * np.pi * f * t + rng.uniform(0.0, 6.0)) for f in np.arange(0.4, 2.0, 0.25)]
        record = Record(f"run {number}", 0.01, {"u": np.sum(waves, axis=0) / 3.0}, {})
        x = simulate(structure, values, record)["x"]
        records.append(record.with_signals(x=x + NOISE * np.std(x) * rng.standard_normal(t.size)))
    scales = characteristic_scales(AXIS, records, VALUES)
    noise = {"x": NOISE * float(np.std(records[0]["x"]))}
    fitted = tuple(records)
    return FitContext(AXIS, fitted, fitted, fitted, scales, noise, frozenset({"k"}), VALUES, given=given)


@pytest.mark.parametrize(("effect", "own"), [(LOPSIDED, {"T_fwd": 0.2, "T_bwd": 0.1}), (EVEN, {"T_c": 0.15})])
def test_it_competes_only_where_even_friction_would_need_a_force(effect, own) -> None:
    context = bench_of(effect, {**VALUES, **own}, {})
    found = {m.names[0]: m for m in fit_candidates(context, reidentify(context, VALUES), [EVEN, LOPSIDED])}
    assert (LOPSIDED.name in found) == (effect is LOPSIDED)
    if effect is LOPSIDED:
        fits = [found[name].fit for name in (LOPSIDED.name, EVEN.name)]
        assert fits[0].cost == pytest.approx(fits[1].cost, rel=1e-2)
        for name, value in own.items():
            assert abs(fits[0].values[name] - value) < 3.0 * fits[0].standard_errors[name]
    other = replace(context, given={"force_off": 0.05})
    assert other.constant_forces_beside([LOPSIDED])["force_off"] == 0.05


@pytest.mark.parametrize("effect", [EVEN, LOPSIDED], ids=["even", "each way"])
def test_a_force_that_was_estimated_is_known_as_well_as_the_other_numbers(effect: Effect) -> None:
    """All given numbers are a little wrong and the force no more than they are; or all others are right."""
    truth = {**VALUES, "force_off": 0.05, "T_c": 0.15, "T_fwd": 0.2, "T_bwd": 0.1}
    wrong = 1.02 if effect is EVEN else 1.0
    given = {"m": wrong * truth["m"], "d": wrong * truth["d"], "force_off": wrong * truth["force_off"]}
    context = bench_of(effect, truth, given)
    found = {m.names[0] for m in fit_candidates(context, reidentify(context, VALUES), [EVEN, LOPSIDED])}
    assert (LOPSIDED.name in found) == (effect is LOPSIDED)


def test_a_force_that_is_known_is_held_where_it_is_known() -> None:
    """The constant force is far from where the given simulation has it: friction alone cannot be it, whichever way it acts."""
    context = bench_of(EVEN, {**VALUES, "T_c": 0.1, "force_off": -0.6}, {"force_off": 0.0})
    found = {m.names[0]: m for m in fit_candidates(context, reidentify(context, VALUES), [EVEN, LOPSIDED])}
    assert found[LOPSIDED.name].fit.values["force_off"] == 0.0
    assert found[LOPSIDED.name].error_over_noise > 10.0 * found[EVEN.name].error_over_noise
