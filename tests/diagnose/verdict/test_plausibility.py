"""Numbers that a rig cannot have are told, and a model with them gives way to one that is hardly worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.verdict.plausibility import doubts, plausible_first
from rigsight.diagnose.verdict.ranking import Grounds, Ranking

PLACES = {"coulomb_friction": "dynamics", "stribeck_friction": "dynamics", "actuator_lag": "actuator"}


def with_numbers(model: FittedModel, values: dict[str, float], errors: dict[str, float]) -> FittedModel:
    fit = replace(model.fit, values=values, standard_errors=errors, free=tuple(values), success=True)
    return replace(model, fit=fit)


@pytest.fixture
def models(scored):
    reidentified = with_numbers(
        scored((), error_over_noise=20.0), {"m": 1.0, "d": 1.0, "k": 100.0}, dict.fromkeys("mdk", 0.1)
    )
    own = {"m": 1.0, "d": 1.0, "k": 100.0}
    coulomb = with_numbers(
        scored(("coulomb_friction",), residuals=np.full(9, 5.5)),
        {**own, "T_c": 0.5},
        dict.fromkeys([*"mdk", "T_c"], 0.1),
    )
    stribeck = with_numbers(
        scored(("stribeck_friction",), residuals=np.full(9, 5.0)),
        {**own, "T_c": 0.5, "T_s": 1.0, "w_s": 0.1},
        {**dict.fromkeys([*"mdk", "T_c"], 0.1), "T_s": np.inf, "w_s": np.inf},
    )
    return reidentified, coulomb, stribeck


def ranked(*models: FittedModel) -> Ranking:
    shares = tuple(np.arange(len(models), 0, -1) / sum(range(len(models) + 1)))
    return Ranking(
        models,
        shares,
        (),
        tuple(Grounds(share, share, None) for share in shares),
    )


def test_plain_numbers_leave_no_doubt(models) -> None:
    reidentified, coulomb, _ = models
    assert doubts(coulomb, reidentified) == ()


def test_numbers_that_records_do_not_determine_are_grave(models) -> None:
    reidentified, _, stribeck = models
    (doubt,) = doubts(stribeck, reidentified)
    assert doubt.grave
    assert "T_s, w_s" in doubt.text


def test_a_stiffness_a_hundred_times_off_and_a_number_at_its_bound_are_told(models) -> None:
    reidentified, coulomb, _ = models
    values = {**coulomb.fit.values, "k": 1.1e4, "T_c": 0.0}
    found = doubts(with_numbers(coulomb, values, coulomb.fit.standard_errors), reidentified)
    assert not any(doubt.grave for doubt in found)
    assert any("k = 1.1e+04" in doubt.text for doubt in found)
    assert any("T_c = 0 is at the bound of its search range" in doubt.text for doubt in found)


def test_a_plausible_model_at_the_same_place_comes_first(models) -> None:
    reidentified, coulomb, stribeck = models
    found = plausible_first(ranked(stribeck, coulomb), reidentified, PLACES)
    assert np.isnan(found.error_of_choice), "no resampling chose it"
    assert found.order[0] is coulomb
    assert found.tied == (stribeck,)
    assert found.probabilities == pytest.approx((2.0 / 3.0, 1.0 / 3.0)), (
        "it takes over the share of the first"
    )
    assert [grounds.share for grounds in found.grounds] == pytest.approx(found.probabilities)


def test_a_model_that_is_far_worse_or_elsewhere_does_not(models, scored) -> None:
    reidentified, coulomb, stribeck = models
    worse = replace(coulomb, error_over_noise=10.0)
    lag = with_numbers(
        scored(("actuator_lag",), residuals=np.full(9, 5.1)), coulomb.fit.values, coulomb.fit.standard_errors
    )
    assert plausible_first(ranked(stribeck, lag, worse), reidentified, PLACES).order[0] is stribeck
