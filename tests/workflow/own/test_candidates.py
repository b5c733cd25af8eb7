"""Candidates that cannot act on a rig are refused; they were searched for in vain."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, effect_named
from rigsight.errors import InputError
from rigsight.rigs import AXIS
from rigsight.workflow.own.own_effects import candidates_of

CAMPAIGN = Campaign("axis", AXIS, {}, {}, ())


def test_candidates_that_all_need_something_else_are_refused() -> None:
    with pytest.raises(InputError, match="'integral_action', 'creep_saturation' cannot act on axis"):
        candidates_of(CAMPAIGN, [effect_named("integral_action"), effect_named("creep_saturation")])


def test_of_a_list_those_that_apply_are_tried() -> None:
    friction = effect_named("coulomb_friction")
    assert candidates_of(CAMPAIGN, [effect_named("integral_action"), friction]) == [friction]
    assert friction in candidates_of(CAMPAIGN, CATALOGUE)


def test_an_effect_that_the_simulation_has_is_no_mistake() -> None:
    friction = effect_named("coulomb_friction")
    assert candidates_of(replace(CAMPAIGN, modelled=(friction,)), [friction]) == []
