"""Numbers that a rig cannot have are told, and a model with them gives way to one that is hardly worse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.verdict.plausibility import doubts, plausible_first
from rigsight.diagnose.verdict.ranking import Grounds, Ranking

from ..conftest import with_numbers

PLACES = {"coulomb_friction": "dynamics", "stribeck_friction": "dynamics", "actuator_lag": "actuator"}


def ranked(*models: FittedModel) -> Ranking:
    shares = tuple(np.arange(len(models), 0, -1) / sum(range(len(models) + 1)))
    return Ranking(
        models,
        shares,
        (),
        tuple(Grounds(share, share, None) for share in shares),
    )


def test_plain_numbers_leave_no_doubt(friction_models) -> None:
    reidentified, coulomb, _ = friction_models
    assert doubts(coulomb, reidentified) == ()


def test_numbers_that_records_do_not_determine_are_grave(friction_models) -> None:
    reidentified, _, stribeck = friction_models
    (doubt,) = doubts(stribeck, reidentified)
    assert doubt.grave
    assert "T_s, w_s" in doubt.text


def test_a_stiffness_a_hundred_times_off_and_a_number_at_its_bound_are_told(friction_models) -> None:
    reidentified, coulomb, _ = friction_models
    values = {**coulomb.fit.values, "k": 1.1e4, "T_c": 0.0}
    found = doubts(with_numbers(coulomb, values, coulomb.fit.standard_errors), reidentified)
    assert not any(doubt.grave for doubt in found)
    assert any("k = 1.1e+04" in doubt.text for doubt in found)
    assert any("T_c = 0 is at the bound of its search range" in doubt.text for doubt in found)


def test_a_plausible_model_at_the_same_place_comes_first(friction_models) -> None:
    reidentified, coulomb, stribeck = friction_models
    found = plausible_first(ranked(stribeck, coulomb), reidentified, PLACES)
    assert np.isnan(found.error_of_choice), "no resampling chose it"
    assert found.order[0] is coulomb
    assert found.tied == (stribeck,)
    assert found.probabilities == pytest.approx((2.0 / 3.0, 1.0 / 3.0)), (
        "it takes over the share of the first"
    )
    assert [grounds.share for grounds in found.grounds] == pytest.approx(found.probabilities)


def test_a_model_that_is_far_worse_or_elsewhere_does_not(friction_models, scored) -> None:
    reidentified, coulomb, stribeck = friction_models
    worse = replace(coulomb, error_over_noise=10.0)
    lag = with_numbers(
        scored(("actuator_lag",), residuals=np.full(9, 5.1)), coulomb.fit.values, coulomb.fit.standard_errors
    )
    assert plausible_first(ranked(stribeck, lag, worse), reidentified, PLACES).order[0] is stribeck
