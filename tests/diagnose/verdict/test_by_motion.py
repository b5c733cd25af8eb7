"""The motion names a family only where it is the most probable main cause and removes the larger part of the missing force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.policy import FAMILIES
from rigsight.diagnose.verdict.families import (
    FamilyAtPlace,
    families_at_places,
    keys_of,
    main_causes,
    shares_of_force,
)
from rigsight.diagnose.verdict.judgement import (
    Judgement,
    by_motion,
    forms_of,
    is_exact,
    with_most_probable_family,
    with_unseen,
)
from rigsight.diagnose.verdict.ranking import Grounds, Ranking
from rigsight.effects import Family, effect_named
from rigsight.inverse import Proposal, ProposedCause, ProposedStart
from rigsight.rigs import AXIS

GAP = 10.0 * np.random.default_rng(0).standard_normal(4000)


def cause(name: str, share: float) -> ProposedCause:
    effect = effect_named(name)
    return ProposedCause(effect, effect.family, AXIS.where(effect), share, {}, (share - 0.05, share + 0.05))


def proposal(*causes: ProposedCause) -> Proposal:
    judged = frozenset(own.effect.name for own in causes)
    return Proposal(causes[:1], causes, judged, causes[0].share, 0.0, noise=0.02)


def ranking(*models: tuple[FittedModel, float]) -> Ranking:
    shares = tuple(share for _, share in models)
    grounds = tuple(Grounds(share, share, None) for share in shares)
    return Ranking(tuple(model for model, _ in models), shares, (), grounds)


def of_none_that_can_be_the_cause(*models: tuple[FittedModel, float]) -> Ranking:
    return replace(ranking(*models), impossible=frozenset(model.names for model, _ in models))


def with_cost(model: FittedModel, cost: float) -> FittedModel:
    return replace(model, fit=replace(model.fit, cost=cost))


@pytest.fixture
def reidentified(scored) -> FittedModel:
    return with_cost(scored((), error_over_noise=10.0, residuals=GAP), 4e5)


@pytest.fixture
def models(scored) -> dict[str, FittedModel]:
    """Simulations of which none lowers the error clearly."""
    names = ("coulomb_friction", "stribeck_friction", "cubic_stiffness")
    return {
        name: with_cost(scored((name,), error_over_noise=9.9, residuals=0.99 * GAP), 3e4) for name in names
    }


def named(judgement: Judgement, found: Proposal, order: Ranking, reidentified: FittedModel) -> Judgement:
    return by_motion(judgement, AXIS, reidentified, order, np.ones(1), found)


def test_the_family_of_the_missing_force_is_named_where_no_simulation_explains_the_gap(
    reidentified, models
) -> None:
    order = ranking(
        (models["cubic_stiffness"], 0.9),
        (models["stribeck_friction"], 0.07),
        (models["coulomb_friction"], 0.03),
    )
    seen = proposal(cause("coulomb_friction", 0.85), cause("cubic_stiffness", 0.1))
    before = Judgement("unknown", reidentified, "")
    found = named(before, seen, order, reidentified)
    assert (found.verdict, found.model.names, found.by_motion) == ("effect", ("stribeck_friction",), True)
    assert "85%" in found.reason
    families = families_at_places(
        AXIS,
        reidentified,
        found.model,
        [(model, 0.0, share) for model, share in zip(order.order, order.probabilities, strict=True)],
        1.0,
        np.ones(1),
        np.random.default_rng(1),
        seen,
        by_motion=True,
    )
    assert families[0].family is Family.DRY_FRICTION
    assert families[0].probability > 0.9
    assert (families[0].share, families[0].interval) == (0.85, pytest.approx((0.8, 0.9)))
    shares = shares_of_force(families, seen)
    assert shares.of == "motion"
    assert shares.families + shares.remainder + shares.noise == pytest.approx(1.0)
    assert shares.noise == 0.02


def test_a_family_none_of_whose_fits_can_be_the_cause_is_not_named(reidentified, models) -> None:
    before = Judgement("unknown", reidentified, "")
    seen = proposal(cause("coulomb_friction", 0.85))
    order = of_none_that_can_be_the_cause((models["coulomb_friction"], 1.0))
    assert named(before, seen, order, reidentified) is before


def test_forms_of_a_family_are_asked_in_the_order_of_the_ranking(models) -> None:
    plain, rounded, other = models.values()
    order = ranking((plain, 0.3), (other, 0.1), (rounded, 0.6))
    friction = keys_of(AXIS, plain.effects)
    assert forms_of(AXIS, order, friction) == [rounded, plain]
    assert forms_of(AXIS, replace(order, impossible=frozenset({rounded.names})), friction) == [plain]


@pytest.mark.parametrize(("error", "is_named"), [(10.1, True), (14.0, False)])
def test_a_force_that_simulations_do_not_see_is_named_with_its_numbers_along_the_motion(
    reidentified, models, error: float, is_named: bool
) -> None:
    # A fast ripple hardly moves the rig: fits end at none. A force that would raise the error is seen, and is not there.
    absent = with_cost(models["coulomb_friction"], reidentified.fit.cost)
    start = ProposedStart({"T_c": 2.0}, {})
    seen = replace(proposal(cause("coulomb_friction", 0.95)), starts={"coulomb_friction": start})
    along, asked = replace(absent, error_over_noise=error, along_motion=True), list[ProposedStart]()

    def as_along_motion(model: FittedModel, start: ProposedStart) -> FittedModel:
        asked.append(start)
        return along

    order = of_none_that_can_be_the_cause((absent, 1.0))
    order = with_unseen(AXIS, reidentified, order, seen, as_along_motion)
    found = named(Judgement("unknown", reidentified, ""), seen, order, reidentified)
    assert asked == [start]
    assert (found.verdict, found.model) == (("effect", along) if is_named else ("unknown", reidentified))


@pytest.mark.parametrize(("kappa", "is_named"), [(1.0, True), (1e-2, False)])
def test_a_ripple_whose_phase_the_simulation_loses_is_named_although_it_would_raise_the_error(
    reidentified, scored, kappa: float, is_named: bool
) -> None:
    absent = with_cost(
        scored(("torque_ripple",), error_over_noise=10.0, residuals=GAP), reidentified.fit.cost
    )
    start = ProposedStart({"T_sin": 1.0, "T_cos": 0.0, "kappa": kappa}, {})
    seen = replace(proposal(cause("torque_ripple", 0.95)), starts={"torque_ripple": start})
    along = replace(absent, error_over_noise=14.0, along_motion=True)
    order = with_unseen(
        AXIS, reidentified, of_none_that_can_be_the_cause((absent, 1.0)), seen, lambda *_: along
    )
    assert (order.order[0] is along) is is_named


def test_a_force_that_no_family_removes_stays_unknown(reidentified, models) -> None:
    order = ranking(*((model, 1.0 / 3.0) for model in models.values()))
    before = Judgement("unknown", reidentified, "")
    seen = proposal(cause("coulomb_friction", 0.2))
    assert named(before, seen, order, reidentified) is before


def test_a_family_that_is_more_probable_than_not_is_named_although_it_removes_less_than_half(
    reidentified, models
) -> None:
    order = ranking(*((model, 1.0 / 3.0) for model in models.values()))
    before = Judgement("unknown", reidentified, "")
    seen = proposal(cause("coulomb_friction", 0.47))
    found = named(before, seen, order, reidentified)
    assert found.verdict == "effect"
    assert "47%" in found.reason


def test_of_two_families_that_remove_as_much_the_more_probable_one_is_named_with_its_probability(
    reidentified, models
) -> None:
    order = ranking((models["cubic_stiffness"], 0.6), (models["coulomb_friction"], 0.4))
    before = Judgement("unknown", reidentified, "")
    seen = proposal(cause("coulomb_friction", 0.8), cause("cubic_stiffness", 0.8))
    found = named(before, seen, order, reidentified)
    assert found.model.names == ("cubic_stiffness",)
    main = main_causes(AXIS, reidentified, list(zip(order.order, (0.6, 0.4), strict=True)), np.ones(1), seen)
    # Both explain much: what is neither has hardly more weight than evidence that fails.
    assert main[Family.SPRING_LAW, "dynamics"] == pytest.approx(0.5 / (1.0 + FAMILIES.failing), abs=0.01)


def test_what_the_motion_cannot_tell_from_a_gain_is_judged_by_simulations_alone(reidentified, scored) -> None:
    limit = with_cost(scored(("input_saturation",), error_over_noise=3.0, residuals=0.3 * GAP), 3e4)
    friction = with_cost(scored(("coulomb_friction",), error_over_noise=6.0, residuals=0.6 * GAP), 3e4)
    models = [(limit, 0.9), (friction, 0.1)]
    seen = proposal(cause("coulomb_friction", 0.8))
    of_limit, of_friction = (Family.DRIVE_LIMIT, "actuator"), (Family.DRY_FRICTION, "dynamics")
    judged = main_causes(AXIS, reidentified, models, np.ones(1), seen)
    assert judged[of_friction] > judged[of_limit]
    left_open = replace(seen, undecided=frozenset({"input_saturation"}))
    found = main_causes(AXIS, reidentified, models, np.ones(1), left_open)
    assert found[of_limit] > 0.9


def test_a_simulation_that_cannot_be_the_cause_is_no_evidence_of_its_family(reidentified, scored) -> None:
    imitation = with_cost(scored(("flexible_mode",), error_over_noise=1.5, residuals=0.15 * GAP), 3e4)
    friction = with_cost(scored(("coulomb_friction",), error_over_noise=5.0, residuals=0.5 * GAP), 3e4)
    models = [(friction, 1.0), (imitation, 0.0)]
    of_mode = (Family.RESONANCE, "dynamics")
    assert main_causes(AXIS, reidentified, models, np.ones(1), None)[of_mode] > 0.3
    impossible = frozenset({imitation.names})
    found = main_causes(AXIS, reidentified, models, np.ones(1), None, impossible)
    assert found[of_mode] < 0.1


def test_a_named_family_is_kept_where_the_motion_names_it_too(reidentified, models) -> None:
    order = ranking((models["coulomb_friction"], 0.9), (models["cubic_stiffness"], 0.1))
    before = Judgement("effect", models["coulomb_friction"], "")
    assert named(before, proposal(cause("stribeck_friction", 0.9)), order, reidentified) is before


@pytest.mark.parametrize(
    ("verdict", "error", "adequate", "exact"),
    [
        ("none", 9.0, False, True),
        ("parameters", 9.0, False, True),
        ("effect", 1.05, False, True),
        ("effect", 9.0, True, True),
        ("effect", 9.0, False, False),
        ("unknown", 9.0, True, False),
    ],
)
def test_a_simulation_that_leaves_noise_decides(
    scored, verdict, error: float, adequate: bool, exact: bool
) -> None:
    best = scored(("coulomb_friction",), error_over_noise=error)
    assert is_exact(Judgement(verdict, best, ""), best, 1.6, lambda _: adequate) is exact


@pytest.mark.parametrize(("of_friction", "named"), [(0.6, "coulomb_friction"), (0.3, "cubic_stiffness")])
def test_the_most_probable_family_is_named_though_the_ranking_puts_another_one_first(
    models, of_friction: float, named: str
) -> None:
    order = ranking((models["cubic_stiffness"], 0.6), (models["coulomb_friction"], 0.4))
    families = [
        FamilyAtPlace(family, "dynamics", probability, 0.5, (0.4, 0.6), ())
        for family, probability in ((Family.SPRING_LAW, 0.38), (Family.DRY_FRICTION, of_friction))
    ]
    before = Judgement("effect", models["cubic_stiffness"], "")
    found = with_most_probable_family(before, AXIS, order, families)
    assert found.model.names == (named,)
