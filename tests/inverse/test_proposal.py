"""Does the regression along the measured motion name the family and the place of what the equations lack?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
import sympy as sp

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, Effect, effect_named
from rigsight.effects.symbols import v
from rigsight.inverse import Proposal, along_motion, propose
from rigsight.inverse.selection import Selection
from rigsight.inverse.term import Term
from rigsight.records import Record
from rigsight.rigs import AXIS, RIGS, Rig
from rigsight.simulate import compose, simulate

from .motor_rig import motor_rig

DT = 2e-3
T = DT * np.arange(4000)
AXIS_VALUES = {"gain": 1.0, "m": 1.0, "d": 4.0, "k": 400.0, "x_off": 0.0, "force_off": 0.0}
TRAIN = {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
NOISE = 1e-3


def campaign(
    rig: Rig, values: Mapping[str, float], effects: Sequence[Effect], amplitudes: Sequence[float]
) -> Campaign:
    structure, rng = compose(rig, effects), np.random.default_rng(0)
    (u,) = rig.inputs
    records = []
    for i, amplitude in enumerate(amplitudes):
        drive = amplitude * np.sin(i + 2.0 * np.pi * (0.3 * T + 0.4 * T**2))
        run = simulate(structure, values, Record(f"run {i}", DT, {u.name: drive}, {}, hold="foh"))
        noisy = {
            s.name: run[s.name] + NOISE * np.std(run[s.name]) * rng.standard_normal(T.size)
            for s in rig.outputs
        }
        records.append(run.with_signals(**noisy))
    own = {p.name for p in rig.parameters}
    constants = {p.name: values[p.name] for p in rig.constants if p.name in values}
    return Campaign("test", rig, constants, {n: v for n, v in values.items() if n in own}, tuple(records))


def proposed(own: Campaign, effects: Sequence[Effect] = CATALOGUE) -> Proposal:
    found = propose(own, {**own.constants, **own.given}, candidates_on(own.rig, effects))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("effect", "values", "family"),
    [
        ("coulomb_friction", {"T_c": 3.0}, "dry_friction"),
        ("cubic_stiffness", {"k_3": 2e5}, "spring_law"),
        ("input_dead_zone", {"u_0": 3.0}, "drive_limit"),
        ("maxwell_branch", {"k_m": 200.0, "tau_m": 0.05}, "viscoelasticity"),
    ],
)
def test_the_family_of_a_missing_effect_comes_first(
    effect: str, values: Mapping[str, float], family: str
) -> None:
    found = proposed(campaign(AXIS, {**AXIS_VALUES, **values}, [effect_named(effect)], (10.0, 20.0)))
    # The sine of a small angle and a cube are one law.
    first = {cause.family for cause in found.alone if cause.share > 0.99 * found.alone[0].share}
    assert family in first
    assert found.taken[0].share > 0.5 > found.by_chance


def test_friction_is_found_at_its_joint() -> None:
    rig = RIGS["drive_train"]
    friction = effect_named("coulomb_friction@motor_bearing")
    found = proposed(campaign(rig, {**TRAIN, "T_c": 0.02}, [friction], (0.8, 1.5)))
    assert (found.taken[0].family, found.taken[0].where) == ("dry_friction", "motor_bearing")


def test_friction_that_holds_a_mass_at_rest_does_not_hide_itself() -> None:
    """At rest friction is any force up to its limit: these rows would speak against every law."""
    values, rng = {**AXIS_VALUES, "k": 0.0, "T_c": 3.0}, np.random.default_rng(0)
    structure = compose(AXIS, [effect_named("coulomb_friction")])
    records = []
    for i in range(2):
        wave = np.sin(np.pi * T + i)
        pulses = 8.0 * np.sign(wave) * (np.abs(wave) > 0.6) + 2.0 * np.sin(1.3 * T)
        run = simulate(structure, values, Record(f"run {i}", DT, {"u": pulses}, {}, hold="foh"))
        records.append(run.with_signals(x=run["x"] + 1e-4 * rng.standard_normal(T.size)))
    found = proposed(Campaign("test", AXIS, {"gain": 1.0}, {"m": 1.0, "d": 4.0, "k": 0.0}, tuple(records)))
    assert (found.taken[0].family, found.alone[0].family) == ("dry_friction", "dry_friction")
    assert found.alone[0].share > 0.9
    assert found.taken[0].values["T_c"] == pytest.approx(3.0, rel=0.1)
    assert found.numbers["m"] == pytest.approx(1.0, rel=0.02)


def test_a_wrong_spring_between_two_masses_is_fitted_and_no_cause() -> None:
    rig = RIGS["drive_train"]
    own = campaign(rig, TRAIN, [], (0.8, 1.5))
    found = propose(
        own, {**own.constants, **own.given, "k_s": 1.6, "d_s": 3e-3}, candidates_on(rig, CATALOGUE)
    )
    assert found is not None
    assert found.taken == ()
    assert found.numbers["k_s"] == pytest.approx(TRAIN["k_s"], rel=0.02)


def test_a_size_that_no_fit_reaches_is_not_proposed() -> None:
    # Of a motion of millimeters a pendulum of some 6000 times the stiffness imitates a cubic spring.
    hidden = [effect_named("cubic_stiffness"), effect_named("quadratic_damping")]
    values = {**AXIS_VALUES, "k_3": 4e5, "c_2": 12.0}
    found = proposed(campaign(AXIS, values, hidden, (1.0, 2.0)))
    assert {cause.effect.name for cause in found.taken} == {"cubic_stiffness", "quadratic_damping"}
    assert "gravity_pendulum" in found.judged
    assert "gravity_pendulum" not in found.starts


@pytest.mark.parametrize("size", [2.0, -2.0])
def test_damping_that_depends_on_the_direction_pushes_either_way(size: float) -> None:
    hidden = effect_named("directional_damping")
    found = proposed(campaign(AXIS, {**AXIS_VALUES, "d_a": size, "v_k": 1.0}, [hidden], (10.0, 20.0)))
    assert found.taken[0].effect.name == "directional_damping"
    assert found.taken[0].values["d_a"] == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(
    ("effect", "values", "number"),
    [
        ("end_stop", {"k_s": 300.0, "s": 0.027}, "s"),
        ("presliding_friction", {"T_c": 4.0, "x_p": 0.011}, "x_p"),
        ("torque_ripple", {"kappa": 61.0, "T_sin": 2.0, "T_cos": 1.0}, "kappa"),
    ],
)
def test_what_lies_between_two_points_of_the_grid_is_found(
    effect: str, values: Mapping[str, float], number: str
) -> None:
    hidden = effect_named(effect)
    found = proposed(campaign(AXIS, {**AXIS_VALUES, **values}, [hidden], (10.0, 20.0)))
    start = found.starts[effect]
    # A loop with two numbers more imitates a short presliding spring, and so does LuGre friction: fits tell them apart.
    rivals = [own.share for own in found.alone if len(own.effect.parameters) <= len(hidden.parameters)]
    assert 1.0 - start.unexplained > max(0.97, *(share - 1e-3 for share in rivals))
    assert start.own[number] == pytest.approx(values[number], rel=0.05)


def test_a_loop_comes_with_the_share_of_the_stiffness_that_it_keeps() -> None:
    """This scales its force, as a coefficient does: it is no parameter of the grid."""
    hidden, values = effect_named("iwan_hysteresis"), {"a": 0.3, "x_s": 0.04, "q": -0.4}
    found = proposed(campaign(AXIS, {**AXIS_VALUES, **values}, [hidden], (10.0, 20.0)))
    assert found.alone[0].effect.name == "iwan_hysteresis"
    start = found.starts["iwan_hysteresis"]
    assert start.numbers["k"] == pytest.approx(AXIS_VALUES["k"], rel=0.06)
    assert start.own == pytest.approx(values, rel=0.06)


@pytest.mark.parametrize(
    ("effect", "values"), [("input_dead_zone", {"u_0": 7.0}), ("input_saturation", {"u_max": 9.0})]
)
def test_what_a_drive_loses_of_its_input_is_found_beside_a_loop(
    effect: str, values: Mapping[str, float]
) -> None:
    loop = {"A": 1.0, "a": 0.4, "beta": 30.0, "gamma": 5.0, "n": 1.3}
    effects = [effect_named(effect), effect_named("bouc_wen_hysteresis")]
    found = proposed(campaign(AXIS, {**AXIS_VALUES, **loop, **values}, effects, (10.0, 20.0)))
    assert (found.taken[0].effect.name, found.taken[0].family) == (effect, "drive_limit")
    assert found.taken[0].values == pytest.approx(values, rel=0.1)
    assert {"memory", "dry_friction"} & {cause.family for cause in found.taken}


@pytest.mark.parametrize("part", [0.5, 0.999, 1.0])
def test_a_loss_that_scales_all_forces_explains_nothing(part: float) -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    terms_of = along_motion(own, {**own.constants, **own.given})
    assert terms_of is not None
    fit, values = terms_of.fit, terms_of.values
    columns = tuple(motion.thinned(part * motion.forces(values)[1])[None] for motion in fit.motions)
    loss = Term(effect_named("input_saturation"), {}, (), (), columns, (False,), is_given=True)
    selection = Selection(fit, values, [loss])
    beside, before = (selection.regression.remainder(chosen) for chosen in (selection.places[0], []))
    assert beside == pytest.approx(before, rel=1e-5) if part < 1.0 else beside > before


def test_a_selection_with_further_terms_is_that_of_all_terms() -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    terms_of = along_motion(own, {**own.constants, **own.given})
    assert terms_of is not None
    few, more = (list(terms_of.of(effect_named(name))) for name in ("coulomb_friction", "end_stop"))
    whole = Selection(terms_of.fit, terms_of.values, [*few, *more])
    grown = Selection(terms_of.fit, terms_of.values, few).with_terms(more)
    assert grown.places == whole.places
    assert np.allclose(grown.regression.matrix, whole.regression.matrix, rtol=1e-12)
    assert np.allclose(grown.regression.products, whole.regression.products, rtol=1e-9)
    assert np.allclose(grown.regression.whole, whole.regression.whole, rtol=1e-9)


def test_friction_of_a_wheel_that_turns_one_way_does_not_take_the_drive_for_its_load() -> None:
    rig, effect = motor_rig("J*d(q)^2/2"), effect_named("asymmetric_stiffness")
    values, rng = {"J": 5e-3, "d": 0.04, "k_v": 1.0, "k_2": 1.5e-5}, np.random.default_rng(0)
    drive = 0.6 + 0.15 * np.sin(2.0 * np.pi * (0.1 * T + 0.2 * T**2)) + 0.1 * np.sin(2.0 * np.pi * 0.37 * T)
    run = simulate(compose(rig, [effect]), values, Record("run", DT, {"u": drive}, {}, hold="foh"))
    record = run.with_signals(angle=run["angle"] + 1e-3 * rng.standard_normal(T.size))
    found = proposed(Campaign("test", rig, {}, {n: values[n] for n in ("J", "d", "k_v")}, (record,)))
    assert found.taken[0].family == "spring_law"
    assert found.numbers["J"] == pytest.approx(values["J"], rel=0.05)


def test_friction_beside_a_constant_force_does_not_drive_both_ways() -> None:
    effect = effect_named("directional_friction")
    term = Term(effect, {}, ("T_fwd", "T_bwd"), (1.0, 1.0), (), (False, False))
    assert term.allows(np.array([-1.0, 2.0]))
    assert not term.allows(np.array([-1.0, -2.0]))


@pytest.mark.parametrize(
    ("effect", "number", "length"),
    [("input_delay", "T_d", 0.01), ("sensor_lag", "T_m", 0.008), ("time_shift", "T_x", -0.01)],
)
def test_a_delay_comes_with_its_length(effect: str, number: str, length: float) -> None:
    hidden = effect_named(effect)
    own = campaign(AXIS, {**AXIS_VALUES, number: length}, [hidden], (10.0, 20.0))
    (cause,) = proposed(own, [hidden]).taken
    assert cause.share > 0.8
    assert cause.values[number] == pytest.approx(length, rel=0.15)


def test_a_tone_and_a_spring_law_are_named_together() -> None:
    hidden = [effect_named("periodic_disturbance"), effect_named("cubic_stiffness")]
    values = {**AXIS_VALUES, "T_p": 6.0, "w_p": 37.0, "k_3": 1e5}
    found = proposed(campaign(AXIS, values, hidden, (10.0, 20.0)))
    of = {cause.effect.name: cause for cause in found.taken}
    assert set(of) == {"periodic_disturbance", "cubic_stiffness"}
    assert of["periodic_disturbance"].values["w_p"] == pytest.approx(37.0, rel=5e-3)
    assert of["periodic_disturbance"].values["T_p"] == pytest.approx(
        6.0, rel=0.1
    )  # to the frequency that records resolve
    assert found.explained > 0.9


def test_in_a_motion_of_one_frequency_an_overtone_is_no_tone() -> None:
    structure = compose(AXIS, [effect_named("cubic_stiffness")])
    runs = [
        simulate(
            structure,
            {**AXIS_VALUES, "k_3": 2e5},
            Record("r", DT, {"u": a * np.sin(9.0 * T)}, {}, hold="foh"),
        )
        for a in (20.0, 40.0)
    ]
    given = {name: value for name, value in AXIS_VALUES.items() if name != "gain"}
    own = Campaign("one frequency", AXIS, {"gain": 1.0}, given, tuple(runs))
    assert "periodic_disturbance" not in proposed(own).judged


def test_a_tone_that_a_controller_counters_is_a_tone() -> None:
    """The input then has nothing but the tone, and the motion nothing of it."""
    own = campaign(AXIS, AXIS_VALUES, [], (10.0, 20.0))
    countered = [r.with_signals(u=r["u"] + 60.0 * np.sin(31.0 * T + i)) for i, r in enumerate(own.records)]
    found = proposed(replace(own, records=tuple(countered)))
    assert found.taken[0].effect.name == "periodic_disturbance"
    assert found.taken[0].values["w_p"] == pytest.approx(31.0, rel=5e-3)


def test_a_tone_that_a_limit_cuts_off_is_a_tone() -> None:
    """A drive that is limited to a square wave follows the motion as well, and takes the line of the tone."""
    own, runs = campaign(AXIS, AXIS_VALUES, [], ()), []
    for i in range(2):
        square = Record("run", DT, {"u": 20.0 * np.sign(np.sin(12.0 * T + i))}, {}, hold="zoh")
        run = simulate(compose(AXIS, []), AXIS_VALUES, square)
        runs.append(run.with_signals(u=run["u"] + 14.0 * np.sin(31.0 * T + i)))
    found = proposed(replace(own, records=tuple(runs)))
    assert found.alone[0].effect.name == "periodic_disturbance"
    assert found.taken[0].values["w_p"] == pytest.approx(31.0, rel=5e-3)


@pytest.mark.parametrize("sharp", [None, 0.02])
def test_a_family_is_proposed_in_its_plainest_form(sharp: float | None) -> None:
    """A sign that is rounded over a small speed is no other law of friction."""
    friction = effect_named("coulomb_friction")
    if sharp is not None:
        torque = sp.Symbol("T_c", real=True) * sp.tanh(v / sharp)
        friction = replace(friction, name="rounded", torque=torque)
    (cause,) = proposed(campaign(AXIS, {**AXIS_VALUES, "T_c": 1.0}, [friction], (20.0, 40.0))).taken
    assert cause.effect.name == "coulomb_friction"
    assert {form.effect.name for form in cause.forms} >= {"stribeck_friction", "directional_friction"}


def test_a_cause_comes_with_its_numbers() -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "k_3": 2e5}, [effect_named("cubic_stiffness")], (10.0, 20.0))
    (cause,) = proposed(own, [effect_named("cubic_stiffness")]).taken
    assert cause.values["k_3"] == pytest.approx(2e5, rel=0.05)


def test_where_nothing_is_missing_nothing_is_taken() -> None:
    found = proposed(campaign(AXIS, AXIS_VALUES, [], (10.0, 20.0)))
    assert found.taken == ()


@pytest.mark.parametrize("n", [3, 12, 20])
def test_a_few_samples_name_nothing(n: int) -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    found = propose(
        replace(own, records=tuple(record.slice(0, n) for record in own.records)),
        {**own.constants, **own.given},
        candidates_on(AXIS, CATALOGUE),
    )
    assert found is None or found.taken == ()


def test_effects_of_somebody_else_are_judged_like_those_of_the_catalogue() -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    mine = [
        replace(effect_named(name), name=f"my_{name}")
        for name in ("coulomb_friction", "maxwell_branch", "input_dead_zone")
    ]
    found = proposed(own, mine)
    assert found.judged == {effect.name for effect in mine}
    assert found.taken[0].effect.name == "my_coulomb_friction"


def test_validation_records_are_not_asked() -> None:
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    first, second = own.records
    held_out = second.with_signals(x=-3.0 * second["x"])
    changed = replace(own, records=(first, replace(held_out, role="validation")))
    alone = replace(own, records=(first,))
    assert proposed(changed).alone[0].share == proposed(alone).alone[0].share


def test_a_motion_that_no_sensor_shows_gives_no_proposal() -> None:
    rig = RIGS["drive_train"]
    own = campaign(rig, TRAIN, [], (0.8,))
    records = tuple(
        replace(r, signals={n: v for n, v in r.signals.items() if n != "load_angle"}) for r in own.records
    )
    hidden = Campaign("test", rig, own.constants, own.parameters, records)
    assert propose(hidden, {**own.constants, **own.given}, candidates_on(rig, CATALOGUE)) is None


def test_a_sensor_that_loses_the_sign_of_its_reading_is_not_asked() -> None:
    # Small changes of a reading that shows the motion: one without its sign does not show it.
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect_named("coulomb_friction")], (10.0, 20.0))
    judged = proposed(own).judged
    assert "rectified_sensor" not in judged
    assert "encoder_eccentricity" in judged


def test_a_held_input_is_no_delay() -> None:
    structure = compose(AXIS)
    drive = 10.0 * np.sin(2.0 * np.pi * (0.3 * T + 0.4 * T**2))
    run = simulate(structure, AXIS_VALUES, Record("run", DT, {"u": drive}, {}, hold="zoh"))
    noisy = run["x"] + NOISE * np.std(run["x"]) * np.random.default_rng(0).standard_normal(T.size)
    given = {name: value for name, value in AXIS_VALUES.items() if name != "gain"}
    own = Campaign("held", AXIS, {"gain": 1.0}, given, (run.with_signals(x=noisy),))
    assert all(cause.share < 0.1 for cause in proposed(own).alone if cause.family == "delay_or_lag")


def test_numbers_beside_an_effect_leave_the_least_force_and_their_curvature_is_that_of_its_square() -> None:
    effect = effect_named("coulomb_friction")
    own = campaign(AXIS, {**AXIS_VALUES, "T_c": 3.0}, [effect], [20.0, 40.0])
    found = proposed(own).numbers_beside
    assert found is not None
    with_it, without = found.beside([effect]), found.beside([])
    truth = np.array([AXIS_VALUES[name] for name in with_it.names])
    at_m = with_it.names.index("m")
    assert with_it.values[at_m] == pytest.approx(1.0, rel=0.01)
    # A change of the mass that friction cannot take over costs its squared force, in units of what is missing.
    away = np.zeros(truth.size)
    away[at_m] = 0.1
    alone = away @ without.curvature @ away
    assert 0.0 < away @ with_it.curvature @ away <= alone * (1.0 + 1e-9)
    assert np.all(np.linalg.eigvalsh(with_it.curvature) >= -1e-9 * np.max(with_it.curvature))
