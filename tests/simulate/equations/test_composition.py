"""Any tuple of effects composes; effects at their null values leave the rig as it was."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from rigsight.effects import CATALOGUE, effect_named
from rigsight.errors import InputError
from rigsight.rigs import AXIS, ELEMENT, RUNNING_GEAR
from rigsight.simulate import compose, parameter_vector, simulate
from rigsight.simulate.equations.composition import without_vanished_effects
from rigsight.units import characteristic_value

TIME = 5e-3 * np.arange(1500)
FORCE = np.sin(2.0 * TIME) + 0.7 * np.sin(9.0 * TIME)


def plausible(structure, values, scales):
    """Add each effect parameter's first start value (or default) to a rig's values."""
    known = dict(values)
    for effect in structure.effects:
        for p in effect.parameters:
            start = p.starts[0] if p.starts else p.default
            scale = 1.0 if p.default is not None else characteristic_value(p.dimension, scales)
            known[structure.parameter_name(effect, p.name)] = start * scale
    return known


AXIS_SCALES = {"x": 0.02, "force": 1.0, "drive": 1.0, "input": 1.0, "time": 0.1, "length": 0.01}


@pytest.mark.slow
def test_all_effects_together(hysteresis_sets, make_record):
    structure = compose(RUNNING_GEAR, [effect for effect in CATALOGUE if RUNNING_GEAR.offers(effect)])
    scales = {"x": 0.02, "force": 0.8, "drive": 0.8, "input": 1.0, "time": 0.1, "length": 0.01}
    names = {p.name for p in (*RUNNING_GEAR.constants, *RUNNING_GEAR.parameters)}
    rig_values = {k: v for k, v in hysteresis_sets["R"].items() if k in names}
    values = plausible(structure, rig_values, scales)
    simulated = simulate(structure, values, make_record(FORCE))
    assert np.ptp(simulated["psi"]) > 1e-3
    assert np.all(np.isfinite(simulated["y"]))


OF_AN_AXIS = [effect for effect in CATALOGUE if AXIS.offers(effect)]
PAIRS = list(combinations([e.name for e in OF_AN_AXIS], 2))
CHOSEN_PAIRS = [PAIRS[i] for i in np.random.default_rng(7).choice(len(PAIRS), 3, replace=False)]


@pytest.mark.parametrize("pair", CHOSEN_PAIRS, ids="+".join)
def test_pairs_compose_in_either_order(pair, axis_values, make_record):
    effects = [effect_named(name) for name in pair]
    structure = compose(AXIS, effects)
    assert compose(AXIS, reversed(effects)) is structure
    simulated = simulate(structure, plausible(structure, axis_values, AXIS_SCALES), make_record(FORCE))
    assert np.ptp(simulated["x"]) > 1e-4


@pytest.mark.slow
def test_every_pair_has_equations():
    for rig in (RUNNING_GEAR, AXIS, ELEMENT):
        offered = [effect for effect in CATALOGUE if rig.offers(effect)]
        for pair in combinations(offered, 2):
            structure = compose(rig, pair)
            assert len(set(structure.names)) == len(structure.names)
            rates = [*(state.limited_rate for state in structure.equations), *structure.outputs]
            free = set().union(*(rate.free_symbols for rate in rates))
            known = {*structure.parameter_symbols, *structure.states}
            assert {s.name for s in free - known} <= {
                "input value",
                "input rate",
                "input curvature",
                "time now",
            }


def test_vanished_effects_are_left_out(axis, axis_values, make_record):
    structure = compose(AXIS, OF_AN_AXIS)
    values = plausible(structure, axis_values, AXIS_SCALES)
    for effect in OF_AN_AXIS:
        for name, null in effect.null_values().items():
            values[structure.parameter_name(effect, name)] = null
    reduced, _ = without_vanished_effects(structure, values)
    assert (reduced.rig, reduced.effects) == (AXIS, ())
    record = make_record(FORCE)
    exact = simulate(axis, axis_values, record)["x"]
    np.testing.assert_array_equal(simulate(structure, values, record)["x"], exact)
    start = np.arange(1.0, 1.0 + len(structure.states)) * 1e-3
    np.testing.assert_array_equal(
        simulate(structure, values, record, initial_state=start)["x"],
        simulate(axis, axis_values, record, initial_state=start[:2])["x"],
    )


def test_leaving_out_an_effect_keeps_the_values_of_the_others(axis_values):
    friction = [effect_named("coulomb_friction"), effect_named("stribeck_friction")]
    structure = compose(AXIS, friction)
    values = {
        **axis_values,
        "coulomb_friction.T_c": 0.0,
        "stribeck_friction.T_c": 0.2,
        "T_s": 0.3,
        "w_s": 0.1,
    }
    reduced, kept = without_vanished_effects(structure, values)
    assert reduced.effect_names == ("stribeck_friction",)
    assert kept["T_c"] == 0.2
    hysteresis = compose(AXIS, [effect_named("bouc_wen_hysteresis"), friction[0]], {"n": 1.0})
    reduced, _ = without_vanished_effects(hysteresis, {**axis_values, "T_c": 0.0, "a": 0.5})
    assert reduced.fixed == (("n", 1.0),)


def test_missing_parameters_are_named(axis_with_friction, axis_values):
    with pytest.raises(InputError, match="T_c"):
        parameter_vector(axis_with_friction, axis_values)
    without_default = {k: v for k, v in axis_values.items() if k != "x_off"}
    assert parameter_vector(axis_with_friction, {**without_default, "T_c": 1.0}).size == 7


def test_effects_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="input_delay"):
        compose(ELEMENT, [effect_named("input_delay")])
    with pytest.raises(InputError, match="twice"):
        compose(AXIS, [effect_named("free_play"), effect_named("free_play")])
