"""What a model leaves goes with nothing where it is right, and with the right thing where it is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.noise.adequacy import Adequacy, Agreement, adequacy, remainder_of
from rigsight.diagnose.search.evidence_for_more import OtherForms
from rigsight.diagnose.search.single_effects import reidentify
from rigsight.effects import Effect, effect_named, placed
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS, RIGS
from rigsight.simulate import compose, simulate

from ...tiers import slow_but

DT, NOISE = 0.01, 2e-5
VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}


def axis_bench(
    effects: tuple[Effect, ...] = (),
    values: dict[str, float] | None = None,
    seed: int = 0,
    disturbance: float = 0.0,
    last: dict[str, float] | None = None,
) -> FitContext:
    """Return records of one mass, moved by multisines; `last` are other numbers of the last record."""
    rng = np.random.default_rng(seed)
    structure, t = compose(AXIS, effects), DT * np.arange(2400)
    records = []
    for i, amplitude in enumerate((0.5, 1.0, 0.7, 0.8)):
        u = amplitude * sum(
            np.cos((2.0 + 1.1 * n) * t + phase) for n, phase in enumerate(rng.uniform(0.0, 6.28, 25))
        )
        push = disturbance * lfilter([0.05], [1.0, -0.95], rng.standard_normal(t.size))
        own = {**VALUES, **(values or {}), **((last or {}) if i == 3 else {})}
        shown = simulate(structure, own, Record(f"r{i}", DT, {"u": u + push}, {}))
        x = shown["x"] + NOISE * rng.standard_normal(t.size)
        records.append(
            Record(f"r{i}", DT, {"u": u, "x": x}, {}, role="validation" if i > 1 else "estimation")
        )
    fitted, scoring = tuple(records[:2]), tuple(records[2:])
    scales = characteristic_scales(AXIS, fitted, VALUES)
    return FitContext(AXIS, fitted, scoring, fitted, scales, {"x": NOISE}, frozenset({"force_off"}), VALUES)


def fitted(context: FitContext, effects: tuple[Effect, ...], values: dict[str, float]) -> FittedModel:
    structure = context.composed(effects)
    fit = context.problem(structure, context.estimation)
    return context.score(effects, fit.fit({**VALUES, **values}, context.free_parameters(structure)))


def asked(context: FitContext, model: FittedModel) -> Adequacy:
    return adequacy(context, model, np.random.default_rng(1))


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", [0.0, 0.05, 0.5])
def test_p_values_of_noise_and_disturbance_are_uniform(disturbance: float) -> None:
    """A disturbing force of 0.5 leaves 80 times the noise, most of it at the resonance."""
    benches = [axis_bench(seed=seed, disturbance=disturbance) for seed in range(16)]
    p_values = [asked(context, reidentify(context, VALUES)).p_value for context in benches]
    assert kstest(p_values, "uniform").pvalue > 0.01


HIDDEN = [
    ("cubic_stiffness", {"k_3": 4e3}, "position of dynamics"),
    ("coulomb_friction", {"T_c": 0.05}, "velocity of dynamics"),
    ("quadratic_damping", {"c_2": 1.0}, "velocity of dynamics"),
    ("input_saturation", {"u_max": 3.0}, "signal of actuator"),
]


@pytest.mark.parametrize(
    ("name", "values", "what"), slow_but(HIDDEN[0], HIDDEN[3], of=HIDDEN), ids=[name for name, _, _ in HIDDEN]
)
def test_a_missing_effect_is_what_the_remainder_goes_with(
    name: str, values: dict[str, float], what: str
) -> None:
    effects = (effect_named(name),)
    context = axis_bench(effects, values)
    without = asked(context, reidentify(context, VALUES))
    assert not without.adequate
    assert without.agreements[0].what == what
    assert asked(context, fitted(context, effects, values)).adequate


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values", "what"),
    [
        ("cubic_stiffness", {"k_3": 50.0}, "position of dynamics"),
        ("quadratic_damping", {"c_2": 0.02}, "velocity of dynamics"),
    ],
)
def test_it_is_told_on_an_element_too(name: str, values: dict[str, float], what: str) -> None:
    """Its motion is prescribed: a missing force shows in the force that is measured, and moves nothing."""
    rig, effects, noise = RIGS["element"], (effect_named(name),), 2e-3
    known = {"d": 0.4, "k": 20.0, "force_off": 0.0}
    rng, t = np.random.default_rng(3), DT * np.arange(2000)
    structure, records = compose(rig, effects), []
    for i, amplitude in enumerate((0.1, 0.2, 0.15)):
        x = amplitude * np.sin(2.0 * np.pi * (0.3 * t + 0.05 * t**2))
        clean = simulate(structure, {**known, **values}, Record(f"r{i}", DT, {"x": x}, {}))
        force = clean["force"] + noise * rng.standard_normal(t.size)
        records.append(Record(f"r{i}", DT, {"x": x, "force": force}, {}))
    estimation, scoring = tuple(records[:2]), tuple(records[2:])
    scales = characteristic_scales(rig, estimation, known)
    context = FitContext(
        rig, estimation, scoring, estimation, scales, {"force": noise}, frozenset({"force_off"}), known
    )
    without = asked(context, reidentify(context, known))
    assert not without.adequate
    assert without.agreements[0].what == what
    completed = context.composed(effects)
    fit = context.problem(completed, estimation).fit({**known, **values}, context.free_parameters(completed))
    assert asked(context, context.score(effects, fit)).adequate


def test_a_number_that_differs_in_one_record_is_told() -> None:
    context = axis_bench(last={"d": 2.0})
    found = asked(context, reidentify(context, VALUES))
    assert not found.adequate
    assert found.agreements[0].what == "record: d"


def train_bench(train: Any, records: Sequence[Record]) -> FitContext:
    """Return records of a drive train, as they were measured."""
    rig = RIGS["drive_train"]
    estimation = tuple(r for r in records if r.role == "estimation")
    scoring = tuple(r for r in records if r.role == "validation")
    scales = characteristic_scales(rig, estimation, train.values)
    noise = {signal.name: train.noise for signal in rig.outputs}
    return FitContext(rig, estimation, scoring, estimation, scales, noise, frozenset(), train.values)


@pytest.mark.slow
def test_the_joint_is_told(train: Any) -> None:
    damping = placed(effect_named("quadratic_damping"), "load_bearing")
    context = train_bench(train, train.records([damping], {"c_2": 1e-3}))
    found = asked(context, reidentify(context, train.values))
    assert not found.adequate
    assert found.agreements[0].what == "velocity of load_bearing"
    assert found.agreements[0].place == "load_bearing"


@pytest.mark.slow
def test_a_sensor_that_drifts_is_told_though_another_one_stands_still(train: Any) -> None:
    """A disturbance wanders too, but moves both sensors: what one of them alone shows is its own."""
    drift = 10.0 * train.noise
    records = [
        r.with_signals(load_angle=r["load_angle"] + drift * np.linspace(-1.0, 1.0, r.n_samples))
        for r in train.records([], {})
    ]
    context = train_bench(train, records)
    found = asked(context, reidentify(context, train.values))
    assert not found.adequate
    assert found.agreements[0].what == "drift of load_angle"
    assert found.place == "load_angle"


def test_what_stands_in_a_few_stretches_is_no_noise() -> None:
    context = axis_bench()
    record = context.scoring[0]
    x = record["x"].copy()
    x[1000:1040] += 30.0 * NOISE
    struck = replace(context, scoring=(record.with_signals(x=x), *context.scoring[1:]))
    found = asked(struck, reidentify(struck, VALUES))
    assert not found.adequate
    assert not found.is_spread


def test_of_a_residual_in_a_few_stretches_the_whole_remains() -> None:
    """What a small part of it correlates with by chance is not told, nor how probable that is."""
    by_chance = Agreement("velocity of dynamics", "dynamics", 0.4, 0.002)
    found = Adequacy(0.4, (by_chance,), is_spread=False)
    model = reidentify(axis_bench(), VALUES)
    without, model = (replace(model, error_over_noise=left) for left in (20.0, 6.0))
    for lower_bound, share in ((True, 36.0 / 400.0), (False, 35.0 / 399.0)):
        left = remainder_of(without, model, found, lower_bound, beside_a_cause=True)
        assert left.share == pytest.approx(share)
        assert "concentrated in a few stretches of the records" in left.text
        assert "p = " not in left.text


@pytest.mark.slow
def test_a_record_without_a_sensor_has_no_quieter_residual(train: Any) -> None:
    """Records of small motion that lack one of two sensors: white noise does not grow with the motion."""
    gentle, middle, strong = sorted(train.records(), key=lambda record: float(np.std(record["load_angle"])))
    alone = replace(gentle, signals={n: s for n, s in gentle.signals.items() if n != "motor_angle"})
    context = train_bench(train, [replace(alone, role="validation"), middle, strong])
    model = reidentify(context, train.values)
    assert adequacy(context, model, np.random.default_rng(1), of_steady_size=True).adequate


def test_a_rounded_sign_is_another_form_and_no_second_effect() -> None:
    """tanh(v / 0.05) in the place of sign(v): what Coulomb friction leaves goes with the velocity."""
    import sympy as sp

    from rigsight.effects import symbols as canonical

    coulomb = effect_named("coulomb_friction")
    T_c = sp.Symbol("T_c", real=True)
    rounded = Effect(
        name="rounded_friction",
        summary="friction whose sign is rounded",
        place=coulomb.place,
        parameters=tuple(p for p in coulomb.parameters if p.name == "T_c"),
        energy=coulomb.energy,
        torque=T_c * sp.tanh(canonical.v / 0.05),
        signature=coulomb.signature,
    )
    context = axis_bench((rounded,), {"T_c": 0.2})
    single = fitted(context, (coulomb,), {"T_c": 0.2})
    assert single.error_over_noise > 1.5
    forms = OtherForms(context, lower_bound=False)
    assert forms.gain(single) > 0.5 * (single.error_over_noise**2 - 1.0)


def test_a_true_second_effect_explains_more_than_other_forms_of_the_first() -> None:
    effects = (effect_named("coulomb_friction"), effect_named("cubic_stiffness"))
    values = {"T_c": 0.05, "k_3": 1e3}
    context = axis_bench(effects, values)
    single = fitted(context, effects[:1], values)
    forms = OtherForms(context, lower_bound=False)
    assert forms.gain(single) < 0.5 * (single.error_over_noise**2 - 1.0)
    pair = fitted(context, effects, values)
    assert forms.with_own_evidence([single], [pair]) == [pair]


@pytest.mark.slow
def test_noise_that_only_motion_makes_is_no_noise_of_a_sensor() -> None:
    context, rng = axis_bench(), np.random.default_rng(7)

    def louder(record: Record) -> Record:
        noise = rng.standard_normal(record.n_samples)
        return record.with_signals(x=record["x"] + 2e-2 * record["x"] * noise)

    moved = replace(
        context,
        estimation=tuple(map(louder, context.estimation)),
        scoring=tuple(map(louder, context.scoring)),
    )
    model = reidentify(moved, VALUES)
    assert asked(moved, model).adequate
    found = adequacy(moved, model, np.random.default_rng(1), of_steady_size=True)
    assert not found.adequate
    assert found.goes_with == "how far dynamics moves"


@pytest.mark.slow
@pytest.mark.parametrize("disturbance", slow_but(0.5, of=[0.0, 0.5]))
def test_noise_and_disturbance_are_as_large_where_nothing_moves(disturbance: float) -> None:
    adequate = []
    for seed in range(8):
        context = axis_bench(seed=seed, disturbance=disturbance)
        model = reidentify(context, VALUES)
        adequate.append(
            adequacy(context, model, np.random.default_rng(1), of_steady_size=True).adequate
            or not asked(context, model).adequate
        )
    assert all(adequate)
