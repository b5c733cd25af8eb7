"""What follows from what a campaign gives: its own parameters, and whether its rig drifts."""

from __future__ import annotations

import pytest

from rigsight.campaign import Campaign
from rigsight.rigs import AXIS, RIGS, RUNNING_GEAR


@pytest.mark.parametrize(("k", "absent"), [(0.0, "k"), (2.0, None), (None, None)])
def test_one_mass_is_without_a_spring_where_its_stiffness_is_given_as_zero(
    k: float | None, absent: str | None
) -> None:
    campaign = Campaign("", AXIS, {"gain": 1.0}, {} if k is None else {"k": k}, ())
    assert campaign.absent_spring == absent
    assert campaign.drifts == (absent is not None)


def test_a_rig_of_several_motions_drifts_where_no_spring_holds_it() -> None:
    train = RIGS["drive_train"]
    assert Campaign("", train, {"k_t": 0.05}, {"k_l": 0.0}, ()).drifts
    assert not Campaign("", train, {"k_t": 0.05}, {"k_s": 0.3, "k_l": 0.1}, ()).drifts


def test_an_alternative_parameter_is_given_in_the_rig_s_own() -> None:
    (alternative, *_) = RUNNING_GEAR.alternatives
    constants = {constant.name: constant.default or 0.5 for constant in RUNNING_GEAR.constants}
    campaign = Campaign("", RUNNING_GEAR, constants, {alternative.parameter.name: 2.0}, ())
    assert campaign.parameters == {alternative.parameter.name: 2.0}
    assert list(campaign.given) == [alternative.gives]
    assert campaign.given == RUNNING_GEAR.in_own_parameters(campaign.parameters, constants)
