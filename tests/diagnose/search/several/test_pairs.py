"""Two effects at once: found, put in order, and not invented where one is enough."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose import diagnose
from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.several import pair_search
from rigsight.diagnose.search.several import pairs as pairs_module
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.pairs import each_once, grown, refit_singles
from rigsight.diagnose.search.several.together import Together
from rigsight.diagnose.search.single_effects import fit_candidates, reidentify
from rigsight.effects import Effect, effect_named
from rigsight.excitation import linear_sweep, step
from rigsight.identify import characteristic_scales
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
DT = 0.01
NOISE = 2e-5
TRIED = ("cubic_stiffness", "coulomb_friction", "actuator_lag", "quadratic_damping")


def measured(effects: dict[str, dict[str, float]], seed: int) -> Campaign:
    rng = np.random.default_rng(seed)
    structure = compose(AXIS, [effect_named(name) for name in effects])
    truth = {**VALUES, **{name: value for own in effects.values() for name, value in own.items()}}
    t = DT * np.arange(2000)
    runs = [
        ("low", "estimation", linear_sweep(t, 0.4, 1.0, 30.0)),
        ("high", "estimation", linear_sweep(t, 1.0, 1.0, 30.0)),
        ("middle", "validation", linear_sweep(t, 0.7, 1.0, 30.0)),
        ("step", "validation", step(t, 0.6, 5.0)),
    ]
    records = []
    for name, role, u in runs:
        clean = simulate(structure, truth, Record(name, DT, {"u": u}, {}, role=role, hold="zoh"))
        records.append(clean.with_signals(x=clean["x"] + rng.normal(scale=NOISE, size=t.size)))
    given = {name: VALUES[name] * 1.05 for name in ("m", "d", "k")}
    return Campaign("two", AXIS, {"gain": 1.0}, given, tuple(records))


@pytest.mark.slow
def test_two_effects_are_found_and_the_stronger_comes_first():
    campaign = measured({"cubic_stiffness": {"k_3": 4e5}, "actuator_lag": {"T_a": 0.01}}, seed=0)
    found = diagnose(campaign, [effect_named(name) for name in TRIED])
    assert found.verdict == "effect"
    assert found.effects == ("cubic_stiffness", "actuator_lag")
    assert found.where == ("dynamics", "actuator")
    assert found.gap["x"].after < 1.1 * found.gap["x"].noise_floor
    best = found.candidates[0]
    assert best.parameters["k_3"].value == pytest.approx(4e5, abs=4.5 * best.parameters["k_3"].std)
    assert best.parameters["T_a"].value == pytest.approx(0.01, abs=4.5 * best.parameters["T_a"].std)
    # Each of the two alone stays among the candidates and leaves more.
    alone = {c.effects: c.error_over_noise for c in found.candidates if len(c.effects) == 1}
    assert alone["cubic_stiffness",] > 2.0
    assert alone["actuator_lag",] > alone["cubic_stiffness",]


@pytest.mark.slow
def test_three_effects_are_found_where_the_second_closes_less_than_half():
    campaign = measured(
        {"cubic_stiffness": {"k_3": 2e5}, "coulomb_friction": {"T_c": 0.05}, "actuator_lag": {"T_a": 0.01}},
        seed=0,
    )
    found = diagnose(campaign, [effect_named(name) for name in TRIED])
    assert found.verdict == "effect"
    assert set(found.effects) == {"cubic_stiffness", "coulomb_friction", "actuator_lag"}
    assert found.effects[0] == "cubic_stiffness"
    assert found.gap["x"].after < 1.1 * found.gap["x"].noise_floor
    best = found.candidates[0]
    for name, true in (("k_3", 2e5), ("T_c", 0.05), ("T_a", 0.01)):
        assert best.parameters[name].value == pytest.approx(true, abs=4.5 * best.parameters[name].std)
    left = {frozenset(c.effects): c.error_over_noise for c in found.candidates}
    pair = min(error_over_noise for effects, error_over_noise in left.items() if len(effects) == 2)
    single = min(error_over_noise for effects, error_over_noise in left.items() if len(effects) == 1)
    assert pair - 1.0 > 0.5 * (single - 1.0)
    assert sum(share["x"] for share in found.effect_shares.values()) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_more_general_law_that_led_alone_gives_way_to_its_special_case_in_a_pair() -> None:
    campaign = measured({"coulomb_friction": {"T_c": 0.05}, "quadratic_damping": {"c_2": 5.0}}, seed=0)
    tried = ("coulomb_friction", "stribeck_friction", "quadratic_damping")
    found = diagnose(campaign, [effect_named(name) for name in tried])
    alone = {c.effects[0]: c.error_over_noise for c in found.candidates if len(c.effects) == 1}
    assert min(alone, key=lambda name: alone[name]) == "stribeck_friction"
    assert set(found.effects) == {"coulomb_friction", "quadratic_damping"}


@pytest.mark.slow
def test_one_effect_stays_one():
    campaign = measured({"coulomb_friction": {"T_c": 0.1}}, seed=1)
    found = diagnose(campaign, [effect_named(name) for name in TRIED])
    assert (found.verdict, found.effects) == ("effect", ("coulomb_friction",))
    assert all(len(candidate.effects) < 2 for candidate in found.candidates)


@pytest.mark.slow
def test_half_of_a_pair_may_have_been_left_out_of_the_singles() -> None:
    records = measured({"cubic_stiffness": {"k_3": 4e5}, "actuator_lag": {"T_a": 0.01}}, seed=0).records
    scales = characteristic_scales(AXIS, records, VALUES)
    fitted, scored = (tuple(r for r in records if r.role == role) for role in ("estimation", "validation"))
    context = FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, frozenset())
    spring, lag = effect_named("cubic_stiffness"), effect_named("actuator_lag")
    reidentified = reidentify(context, VALUES)
    singles = fit_candidates(context, reidentified, [spring])
    pairs = grown(
        context,
        singles,
        [spring, lag],
        VERDICT.at_floor,
        reidentified.error_over_noise,
        OtherForms(context, lower_bound=False),
        Together(context, reidentified, [spring, lag]),
        lambda _: True,
    )
    assert [pair.names for pair in pairs] == [("cubic_stiffness", "actuator_lag")]


def test_of_models_with_the_same_effects_the_best_is_kept(scored) -> None:
    two = ("coulomb_friction", "cubic_stiffness")
    worse, better = scored(two, error_over_noise=1.4), scored(two[::-1], error_over_noise=1.1)
    other = scored(("coulomb_friction", "backlash"), error_over_noise=1.2)
    assert each_once([worse, other, better]) == [better, other]


def test_second_effects_are_not_tried_beside_one_that_explains_nothing(
    monkeypatch: pytest.MonkeyPatch, scored
) -> None:
    nothing, spring = effect_named("actuator_lag"), effect_named("power_law_stiffness")
    singles = [
        scored((nothing.name,), error_over_noise=10.0, residuals=np.ones(8), n_free=4),
        scored((spring.name,), error_over_noise=8.0, residuals=np.ones(8), n_free=6),
    ]
    beside: list[str] = []

    def tried(_: FitContext, parent: FittedModel, *rest: object, **options: object) -> list[FittedModel]:
        beside.extend(parent.names)
        return []

    monkeypatch.setattr(pair_search, "with_one_more", tried)
    monkeypatch.setattr(pairs_module, "refine", lambda _, pairs: pairs)
    forms = SimpleNamespace(partners=lambda parent, effects: effects)
    together = SimpleNamespace(fitted=lambda size: [])
    grown(None, singles, [nothing, spring], VERDICT.at_floor, 9.0, forms, together, lambda _: True)
    assert beside == ["power_law_stiffness"]


@pytest.mark.parametrize(
    ("left", "is_noise", "extended"),
    [(1.0, False, False), (1.05, True, False), (1.05, False, True), (1.2, True, True)],
)
def test_a_pair_near_the_floor_is_extended_if_it_leaves_more_than_noise(
    monkeypatch: pytest.MonkeyPatch, scored, left: float, is_noise: bool, extended: bool
) -> None:
    two = ("coulomb_friction", "cubic_stiffness")
    single = scored(two[:1], residuals=np.full(8, 9.0))
    pair = scored(two, residuals=np.full(8, left))
    asked: list[str] = []

    def third(*_: object) -> list[FittedModel]:
        asked.append("third")
        return []

    monkeypatch.setattr(pairs_module, "with_a_third", third)
    monkeypatch.setattr(pairs_module, "refine", lambda _, pairs: pairs)
    monkeypatch.setattr(pairs_module, "finished", lambda _, pair: pair)
    monkeypatch.setattr(pairs_module, "_added_one_by_one", lambda _search, _worthwhile, pairs: pairs)
    monkeypatch.setattr(pairs_module, "with_similar", lambda _, pairs, *rest: pairs)
    monkeypatch.setattr(pairs_module, "without_repeated_equations", lambda _, models: models)
    together = SimpleNamespace(fitted=lambda size: [pair] if size == 2 else [])
    effects = [effect_named(name) for name in two]
    found = grown(None, [single], effects, VERDICT.at_floor, 9.0, None, together, lambda _: is_noise)
    assert found == [pair]
    assert asked == ["third"] * extended


def test_a_single_that_stopped_short_is_found_again_from_a_pair() -> None:
    play, spring = effect_named("backlash"), effect_named("cubic_stiffness")
    records = measured({"backlash": {"g": 1e-3}}, seed=2).records
    scales = characteristic_scales(AXIS, records, VALUES)
    fitted, scored = (tuple(r for r in records if r.role == role) for role in ("estimation", "validation"))
    context = FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, frozenset())

    def model(effects: tuple[Effect, ...], own: dict[str, float]) -> FittedModel:
        structure = context.composed(effects)
        fit = context.problem(structure, fitted).fit({**VALUES, **own}, [])
        free = tuple(context.free_parameters(structure))
        return context.score(effects, replace(fit, free=free))

    stopped, other = model((play,), {"g": 4e-4}), model((spring,), {"k_3": 1e4})
    pair = model((play, spring), {"g": 1.01e-3, "k_3": 1e3})
    assert stopped.error_over_noise > 3.0 * pair.error_over_noise
    again, same = refit_singles(context, [stopped, other], [pair])
    assert again.names == ("backlash",)
    assert again.error_over_noise == pytest.approx(1.0, abs=0.1)
    assert again.fit.values["g"] == pytest.approx(1e-3, rel=0.01)
    assert same.error_over_noise <= other.error_over_noise
    assert refit_singles(context, [again, other], [])[0] is again
