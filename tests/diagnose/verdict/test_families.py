"""Families at places: probability over all their forms, shares that add up with remainder and noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.policy import FAMILIES, SEARCH
from rigsight.diagnose.verdict.families import (
    families_at_places,
    probable_part,
    shares_of_gap,
    with_shown_families,
    yielding_part,
)
from rigsight.effects import CATALOGUE, Family, effect_named
from rigsight.inverse import Proposal, ProposedCause
from rigsight.rigs import AXIS

N = 4000
GAP = 10.0 * np.random.default_rng(0).standard_normal(N)
NOISE = np.random.default_rng(2).standard_normal(N)


@pytest.fixture
def families(scored):
    def of(*candidates: tuple[tuple[str, ...], np.ndarray, float, float], outside: float = 0.0):
        models = [(scored(names, residuals=left), chance, share) for names, left, chance, share in candidates]
        reidentified = scored((), residuals=GAP)
        found = families_at_places(
            AXIS, reidentified, models[0][0], models, outside, np.ones(1), np.random.default_rng(1)
        )
        return found, shares_of_gap(found, reidentified, models[0][0], is_adequate=False)

    return of


def test_every_effect_of_the_catalogue_has_a_family() -> None:
    assert all(effect.family is not Family.OWN for effect in CATALOGUE)


def test_forms_that_share_a_probability_make_a_certain_family(families) -> None:
    found, shares = families(
        (("coulomb_friction",), 3.0 * NOISE, 0.45, 0.5),
        (("stribeck_friction",), 3.0 * NOISE, 0.3, 0.3),
        (("directional_friction",), 3.1 * NOISE, 0.15, 0.2),
        (("cubic_stiffness",), 6.0 * NOISE, 0.005, 0.0),
    )
    (friction,) = found
    assert (friction.family, friction.where) == (Family.DRY_FRICTION, "dynamics")
    assert friction.probability == pytest.approx(0.9)
    assert friction.interval[0] < friction.share < friction.interval[1]
    assert friction.share == pytest.approx(0.91, abs=0.01)
    assert [form.effects for form in friction.forms] == [
        ("coulomb_friction",), ("stribeck_friction",), ("directional_friction",),
    ]  # fmt: skip
    assert sum(form.probability for form in friction.forms) == pytest.approx(1.0)
    assert shares.families + shares.remainder + shares.noise == pytest.approx(1.0)
    assert shares.remainder == pytest.approx(0.08, abs=0.01)


def test_a_law_that_is_no_exact_form_belongs_to_the_family_that_explains_the_gap(families) -> None:
    left = 0.4 * GAP
    found, _ = families(
        (("coulomb_friction",), left, 0.004, 0.7), (("stribeck_friction",), left, 0.002, 0.3), outside=0.99
    )
    # It leaves 0.16: the evidence of that beside the weight of any other cause.
    weight = 0.16**-FAMILIES.per_simulation
    assert found[0].probability == pytest.approx(
        0.006 + 0.99 * weight / ((1.0 + FAMILIES.failing) * weight + FAMILIES.other_causes), abs=0.01
    )


def test_evidence_that_may_fail_makes_nothing_certain(families) -> None:
    found, _ = families((("coulomb_friction",), 1e-3 * GAP, 0.0, 1.0), outside=1.0)
    assert found[0].probability < 1.0 / (1.0 + FAMILIES.failing) < 0.98


def test_a_rival_has_no_share_in_the_model_but_says_what_it_would_explain(families) -> None:
    found, _ = families(
        (("coulomb_friction",), 3.0 * NOISE, 0.7, 0.7), (("input_delay",), 4.0 * NOISE, 0.3, 0.3)
    )
    assert [own.family for own in found] == [Family.DRY_FRICTION, Family.DELAY_OR_LAG]
    assert (found[1].where, found[1].share) == ("actuator", 0.0)
    assert 0.7 < found[1].interval[1] < 0.95


def test_two_causes_divide_what_they_explain_together(families) -> None:
    first = np.arange(N) % 100 < 60
    found, shares = families(
        (("coulomb_friction", "input_delay"), NOISE, 0.8, 0.9),
        (("coulomb_friction",), np.where(first, NOISE, GAP), 0.0, 0.05),
        (("input_delay",), np.where(first, GAP, NOISE), 0.0, 0.05),
    )
    assert [own.share for own in found] == pytest.approx([0.6, 0.4], abs=0.05)
    assert shares.families == pytest.approx(0.99, abs=0.01)
    assert shares.remainder == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("by_chance", [0.0, 0.75])
def test_a_family_that_explains_the_force_along_the_motion_is_more_probable(scored, by_chance: float) -> None:
    models = [
        (scored((name,), residuals=0.7 * GAP), 0.0, 0.5) for name in ("coulomb_friction", "cubic_stiffness")
    ]
    seen = ProposedCause(effect_named("coulomb_friction"), Family.DRY_FRICTION, "dynamics", 0.5, {})
    proposal = Proposal((seen,), (seen,), frozenset({"coulomb_friction", "cubic_stiffness"}), 0.5, by_chance)
    rng = np.random.default_rng(1)
    equations = scored((), residuals=GAP)
    # Both fits lower the cost: effects of no size would not count.
    equations = replace(equations, fit=replace(equations.fit, cost=100.0 * equations.fit.cost))
    found = families_at_places(AXIS, equations, models[0][0], models, 1.0, np.ones(1), rng, proposal)
    by_family = {own.family: own for own in found}
    friction, spring = by_family[Family.DRY_FRICTION], by_family[Family.SPRING_LAW]
    of_law = SEARCH.law_error**2
    expected = ((1.0 + of_law) / (0.5 + of_law)) ** (FAMILIES.per_motion * (1.0 - by_chance))
    assert friction.probability / spring.probability == pytest.approx(expected, rel=1e-6)
    assert (friction.along_motion, spring.along_motion) == (0.5, None)
    assert friction.to_json()["along_motion"] == 0.5


@pytest.mark.parametrize(
    ("remainder", "kept"), [(8.8, ("cubic_stiffness",)), (2.0, ("cubic_stiffness", "coulomb_friction"))]
)
def test_a_further_family_is_named_only_where_it_removes_most_of_the_remainder(
    scored, remainder: float, kept: tuple[str, ...]
) -> None:
    left = np.ones(8)
    both = scored(("cubic_stiffness", "coulomb_friction"), error_over_noise=remainder, residuals=left)
    alone = scored(("cubic_stiffness",), error_over_noise=9.8, residuals=left)
    friction = scored(("coulomb_friction",), error_over_noise=60.0, residuals=left)
    reidentified = scored((), error_over_noise=60.0)
    assert probable_part(AXIS, reidentified, both, [both, alone, friction]).names == kept


def test_two_families_that_add_what_laws_err_are_not_named_although_no_set_with_one_of_them_was_fitted(
    scored,
) -> None:
    left = np.ones(8)
    names = ("asymmetric_stiffness", "presliding_friction", "iwan_hysteresis", "time_shift")
    all_of_them = scored(names, error_over_noise=2.6, residuals=left)
    pair = scored(names[:2], error_over_noise=3.2, residuals=left)
    spring = scored(names[:1], error_over_noise=8.0, residuals=left)
    reidentified = scored((), error_over_noise=20.1)
    assert probable_part(AXIS, reidentified, all_of_them, [all_of_them, pair, spring]) is pair


@pytest.mark.parametrize(
    ("name", "values", "part"),
    [
        ("iwan_hysteresis", {"x_s": 0.02, "a": 0.5, "q": 0.0}, 0.01),
        ("iwan_hysteresis", {"x_s": 0.6, "a": 0.0, "q": 0.0}, 0.3),
        ("bouc_wen_hysteresis", {"beta": 60.0, "gamma": 40.0, "n": 1.0, "a": 0.1}, 0.005),
        ("bouc_wen_hysteresis", {"beta": 6.0, "gamma": 3.0, "n": 2.0, "a": 0.1}, 1.0 / 6.0),
        # It never yields, and the last one stiffens.
        ("bouc_wen_hysteresis", {"beta": 4.0, "gamma": -4.0, "n": 1.0, "a": 0.1}, None),
        ("bouc_wen_hysteresis", {"beta": 3.0, "gamma": -4.0, "n": 1.5, "a": 0.1}, None),
        ("coulomb_friction", {"T_c": 0.1}, None),
    ],
)
def test_a_hysteresis_that_yields_at_once_is_dry_friction(
    scored, name: str, values: dict[str, float], part: float | None
) -> None:
    model = scored((name,), residuals=GAP)
    model = replace(model, fit=replace(model.fit, values=values))
    (effect,) = model.effects
    scales = {"x": 2.0}
    assert yielding_part(model, effect, scales) == (None if part is None else pytest.approx(part))
    (shown,) = with_shown_families(model, scales).effects
    at_once = part is not None and part < FAMILIES.yields_at_once
    assert shown == (replace(effect, family=Family.DRY_FRICTION) if at_once else effect)
