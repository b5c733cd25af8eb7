"""Several effects at once: found, put in order, and not invented where one is enough."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search import several_effects as several
from rigsight.diagnose.search.one_more_effect import each_once, part_of
from rigsight.diagnose.search.several_effects import SeveralEffects, refit_singles, several_effects
from rigsight.diagnose.search.single_effects import fit_candidate, fit_candidates, reidentify
from rigsight.diagnose.search.together import Together
from rigsight.diagnose.search.worth_fitting import SingleModels, WorthFitting
from rigsight.effects import Effect, effect_named
from rigsight.excitation import linear_sweep, step
from rigsight.identify import characteristic_scales
from rigsight.identify.fit.windows import Windowing
from rigsight.inverse import Proposal, ProposedCause
from rigsight.records.record import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate

VALUES = {"gain": 1.0, "m": 1.0, "d": 1.6, "k": 100.0, "x_off": 0.0, "force_off": 0.0}
DT = 0.01
NOISE = 2e-5
TRIED = ("cubic_stiffness", "coulomb_friction", "actuator_lag", "quadratic_damping")


def measured(effects: dict[str, dict[str, float]], seed: int, **values: float) -> Campaign:
    rng = np.random.default_rng(seed)
    structure = compose(AXIS, [effect_named(name) for name in effects])
    own = {name: value for parameters in effects.values() for name, value in parameters.items()}
    truth = {**VALUES, **values, **own}
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


def context_of(campaign: Campaign, held: frozenset[str] = frozenset()) -> FitContext:
    records = campaign.records
    scales = characteristic_scales(AXIS, records, VALUES)
    fitted, scored = (tuple(r for r in records if r.role == role) for role in ("estimation", "validation"))
    return FitContext(AXIS, fitted, scored, fitted, scales, {"x": NOISE}, held, VALUES)


def searching(
    context: FitContext, without: FittedModel, singles: list[FittedModel], effects: list[Effect]
) -> SeveralEffects:
    """Return the search where the motion does not show the missing force."""
    together = Together(context, without, effects)

    def is_settled(model: FittedModel) -> bool:
        return model.error_over_noise <= VERDICT.at_floor

    return SeveralEffects(
        context,
        singles,
        singles[0],
        None,
        None,
        effects,
        together,
        lambda _: None,
        without,
        np.inf,
        is_settled,
    )


def test_the_search_goes_on_from_what_the_motion_names_where_another_effect_leads() -> None:
    """Nothing helps an effect further that imitates several causes; the first that the motion names is one of them."""
    hidden = {"actuator_lag": {"T_a": 0.03}, "asymmetric_stiffness": {"k_2": 500.0}}
    context = context_of(measured(hidden, seed=0), frozenset({"force_off"}))
    effects = [effect_named(name) for name in ("quadratic_damping", *hidden)]
    without = reidentify(context, VALUES)
    singles = [fit_candidate(context, (effect,), without.fit) for effect in effects[:2]]
    late = ProposedCause(effects[1], effects[1].family, AXIS.where(effects[1]), 0.6, {})
    judged = frozenset(effect.name for effect in effects)
    search = replace(
        searching(context, without, singles, effects),
        together=Together(context, without, ()),
        proposal=Proposal((late,), (late,), judged, explained=0.6, by_chance=0.1),
        enough=0.0,
    )
    assert frozenset(hidden) in {frozenset(model.names) for model in search.found()}
    assert replace(search, singles=singles[:1]).found() == []


@pytest.mark.slow
def test_half_of_a_pair_may_have_been_left_out_of_the_singles() -> None:
    context = context_of(measured({"cubic_stiffness": {"k_3": 4e5}, "actuator_lag": {"T_a": 0.01}}, seed=0))
    spring, lag = effect_named("cubic_stiffness"), effect_named("actuator_lag")
    reidentified = reidentify(context, VALUES)
    singles = fit_candidates(context, reidentified, [spring])
    pairs = searching(context, reidentified, singles, [spring, lag]).found()
    assert [pair.names for pair in pairs] == [("cubic_stiffness", "actuator_lag")]


@pytest.mark.slow
def test_a_relative_gives_way_to_the_right_effect() -> None:
    hidden = {"input_saturation": {"u_max": 0.5}, "iwan_hysteresis": {"a": 0.3, "x_s": 0.003, "q": 0.0}}
    context = context_of(measured(hidden, seed=0, d=3.0), frozenset({"force_off"}))
    saturation, relative = effect_named("input_saturation"), effect_named("presliding_friction")
    effects = [saturation, relative, effect_named("iwan_hysteresis")]
    reidentified = reidentify(context, VALUES)
    singles = fit_candidates(context, reidentified, effects)
    alone = next(model for model in singles if model.names == ("input_saturation",))
    pair = fit_candidate(context, (saturation, relative), alone.fit)
    assert pair.error_over_noise > 1.1
    search = searching(context, reidentified, singles, effects)
    found = search.exchanged(pair, relative, alone)
    best = min(found, key=lambda model: model.error_over_noise)
    assert set(best.names) == {"input_saturation", "iwan_hysteresis"}
    assert best.error_over_noise < 1.05
    assert best.fit.values["u_max"] == pytest.approx(0.5, rel=1e-2)


@pytest.mark.slow
def test_a_part_that_stopped_short_is_found_again_from_a_triple() -> None:
    two, hidden = ("input_saturation", "asymmetric_stiffness"), {"u_max": 0.5, "k_2": 500.0}
    campaign = measured({two[0]: {"u_max": 0.5}, two[1]: {"k_2": 500.0}}, seed=0)
    context = context_of(campaign, frozenset({"force_off"}))
    effects = tuple(effect_named(name) for name in (*two, "cubic_stiffness"))
    structure = context.composed(effects)
    fit = context.problem(structure, context.estimation).fit({**VALUES, **hidden, "k_3": 10.0}, [])
    triple = context.score(effects, replace(fit, free=tuple(context.free_parameters(structure))))
    part = part_of(context, triple, effects[:2])
    assert part.error_over_noise == pytest.approx(1.0, abs=0.1)
    assert part.fit.values["u_max"] == pytest.approx(0.5, rel=0.01)


def test_of_models_with_the_same_effects_the_best_is_kept(scored) -> None:
    two = ("coulomb_friction", "cubic_stiffness")
    worse, better = scored(two, error_over_noise=1.4), scored(two[::-1], error_over_noise=1.1)
    other = scored(("coulomb_friction", "backlash"), error_over_noise=1.2)
    assert each_once([worse, other, better]) == [better, other]


def single_models(reidentified: FittedModel, single: FittedModel, worth: WorthFitting) -> SingleModels:
    return SingleModels(Windowing(), None, reidentified, reidentified, [single], None, None, (), worth, None)


@pytest.fixture
def any_single_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether a scored model can be the cause, which was not fitted, is not asked."""
    monkeypatch.setattr(several, "leading", lambda _context, singles: singles[0])


@pytest.mark.usefixtures("any_single_leads")
@pytest.mark.parametrize(
    ("single", "pair", "adequate", "competes"),
    [
        pytest.param(1.9, 1.02, False, True, id="reaches the very bound"),
        pytest.param(1.9, 1.3, False, False, id="may as well fit noise"),
        pytest.param(1.9, 1.02, True, False, id="nothing but noise remains already"),
        pytest.param(20.0, 1.3, False, True, id="more remains than noise could be"),
        pytest.param(1.9, 1.3, None, True, id="a measured floor"),
    ],
)
def test_above_a_lower_bound_a_pair_must_reach_it(
    scored, monkeypatch: pytest.MonkeyPatch, single: float, pair: float, adequate: bool | None, competes: bool
) -> None:
    found = [scored(("periodic_disturbance", "cubic_stiffness"), error_over_noise=pair)]
    monkeypatch.setattr(SeveralEffects, "found", lambda _: found)
    alone = scored(("periodic_disturbance",), error_over_noise=single, residuals=np.ones(8))
    checks = SimpleNamespace(is_adequate=lambda _: adequate)
    models = single_models(scored((), error_over_noise=40.0), alone, WorthFitting())
    kept = several_effects(models, lambda _: None, checks, adequate is not None)
    assert kept == (found if competes else [])


@pytest.mark.usefixtures("any_single_leads")
@pytest.mark.parametrize(
    ("single", "adequate", "lower_bound", "is_asked"),
    [
        pytest.param(1.06, False, False, True, id="near the floor, and no noise"),
        pytest.param(1.06, True, False, False, id="near the floor, noise"),
        pytest.param(1.02, False, False, False, id="at the floor"),
        pytest.param(5.0, False, False, True, id="far above it"),
        pytest.param(2.0, False, True, True, id="a lower bound, and no noise"),
        pytest.param(2.0, True, True, False, id="a lower bound, noise"),
        pytest.param(1.06, False, True, False, id="at a lower bound"),
    ],
)
def test_near_the_floor_a_remainder_that_is_no_noise_asks_for_a_second_effect(
    scored,
    monkeypatch: pytest.MonkeyPatch,
    single: float,
    adequate: bool,
    lower_bound: bool,
    is_asked: bool,
) -> None:
    asked: list[bool] = []

    def found(_search: SeveralEffects) -> list[FittedModel]:
        asked.append(True)
        return []

    monkeypatch.setattr(SeveralEffects, "found", found)
    alone = scored(("periodic_disturbance",), error_over_noise=single, residuals=np.ones(8))
    checks = SimpleNamespace(is_adequate=lambda _: adequate)
    models = single_models(scored((), error_over_noise=15.0), alone, WorthFitting())
    several_effects(models, lambda _: None, checks, lower_bound)
    assert bool(asked) == is_asked


@pytest.mark.usefixtures("any_single_leads")
def test_a_remainder_too_small_to_part_a_pair_from_a_single_effect_asks_for_none(scored) -> None:
    single = scored(("iwan_hysteresis",), error_over_noise=1.08, residuals=np.ones(8))
    checks = SimpleNamespace(is_adequate=lambda _: False)
    models = single_models(scored((), error_over_noise=130.0), single, WorthFitting())
    assert several_effects(models, lambda _: None, checks, False) == []


@pytest.mark.usefixtures("any_single_leads")
def test_a_residual_of_the_size_of_a_law_error_asks_for_no_second_effect(scored) -> None:
    single = scored(("cubic_stiffness",), error_over_noise=1.9, residuals=np.ones(8))
    models = single_models(scored((), error_over_noise=40.0), single, WorthFitting(is_shown=True))
    assert several_effects(models, lambda _: None, None, False) == []


def test_a_single_that_stopped_short_is_found_again_from_a_pair() -> None:
    play, spring = effect_named("backlash"), effect_named("cubic_stiffness")
    context = context_of(measured({"backlash": {"g": 1e-3}}, seed=2))

    def model(effects: tuple[Effect, ...], own: dict[str, float]) -> FittedModel:
        structure = context.composed(effects)
        fit = context.problem(structure, context.estimation).fit({**VALUES, **own}, [])
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
