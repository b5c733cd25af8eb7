"""Effects of the given simulation, and those that are asked for, are identified with the rig, whatever its kind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, effect_named, placed
from rigsight.identify.identification import Identification
from rigsight.records import Record
from rigsight.workflow.campaign.in_memory import make_campaign, make_model
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.identification.json import identification_json
from rigsight.workflow.identify import checked_options, identify_campaign
from rigsight.workflow.own.own_effects import effect_on
from rigsight.workflow.simulate import simulate_model

DT = 5e-3
BY_DEFAULT = checked_options("local_rational", None)


class Case(NamedTuple):
    """A rig with one effect: truth, given values (sizes of zero lie on a bound), amplitude of the input, noise of a sensor."""

    rig: str
    effect: str
    truth: Mapping[str, float]
    given: Mapping[str, float]
    amplitude: float
    noise: float


AXIS = {"m": 2.0, "d": 12.0, "k": 800.0}
CASES = (
    Case("axis", "coulomb_friction", {**AXIS, "T_c": 1.5}, {**AXIS, "d": 0.0, "T_c": 0.0}, 10.0, 1e-5),
    Case("axis", "input_delay", {**AXIS, "T_d": 0.012}, {"T_d": 0.0}, 10.0, 1e-5),
    Case(
        "element",
        "coulomb_friction",
        {"d": 3.0, "k": 40.0, "force_off": 0.2, "T_c": 0.1},
        {"T_c": 0.0},
        0.02,
        1e-3,
    ),
    Case(
        "running_gear",
        "coulomb_friction",
        {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "J_z": 0.56, "k_c": 81.0, "k_d": 2.0, "l_0": 0.25}
        | {"c_y": 0.98, "T_c": 0.05},
        {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27, "T_c": 0.0},
        1.0,
        1e-6,
    ),
    Case(
        "drive_train",
        "coulomb_friction@motor_bearing",
        {"k_t": 0.05, "J_m": 1e-4, "J_l": 5e-4, "k_s": 2.0, "d_s": 1e-3, "d_m": 1e-3, "d_l": 1e-3, "k_l": 0.5}
        | {"T_c": 5e-3},
        {"k_t": 0.05, "T_c": 0.0},
        1.0,
        1e-4,
    ),
)


def recorded(case: Case) -> Campaign:
    """Return a campaign of one sweep of the true rig with its effect, which the given simulation has too."""
    t = DT * np.arange(800)
    model = make_model(case.rig, case.truth, [case.effect])
    rig, rng = model.structure.rig, np.random.default_rng(0)
    drive = case.amplitude * np.sin((3.0 + 4.0 * t) * t)
    units = {signal.name: signal.unit for signal in rig.inputs}
    inputs = Record("sweep", DT, dict.fromkeys(units, drive), units)
    clean = simulate_model(model, inputs)
    read = {s.name: clean[s.name] + rng.normal(scale=case.noise, size=t.size) for s in rig.outputs}
    names = {constant.name for constant in rig.constants}
    return make_campaign(
        rig,
        [clean.with_signals(**read)],
        constants={name: value for name, value in case.given.items() if name in names},
        parameters={name: value for name, value in case.given.items() if name not in names},
        effects=[case.effect],
    )


def identified(campaign: Campaign) -> Identification:
    return identify_campaign(campaign, BY_DEFAULT)


# Start values of a rig with several motions take seconds.
@pytest.mark.parametrize(
    "case",
    [*CASES[:-1], pytest.param(CASES[-1], marks=pytest.mark.slow)],
    ids=lambda case: f"{case.rig}-{case.effect}",
)
def test_the_parameters_of_rig_and_effect_are_found_together(case: Case) -> None:
    campaign = recorded(case)
    found = identified(campaign)
    fit = found.joint.fit.fit
    own = [name for name in case.truth if name not in campaign.constants]
    for name in own:
        assert abs(fit.values[name] - case.truth[name]) < 4.0 * fit.standard_errors[name] < np.inf, name
    content = identification_json(found, {})
    assert content["effects"] == found.model["effects"] == [case.effect]
    effect_parameters = found.model["effect_parameters"]
    assert effect_parameters.keys() <= content["joint"]["parameters"].keys()
    assert effect_parameters.keys() <= content["records"][0]["parameters"].keys()


@pytest.mark.parametrize(
    ("case", "asked"),
    [
        (CASES[0], "coulomb_friction"),
        (CASES[0], "coulomb_friction@dynamics"),
        (CASES[1], "input_delay"),
        (CASES[2], "coulomb_friction"),
        pytest.param(CASES[-1], "coulomb_friction@motor_bearing", marks=pytest.mark.slow),
    ],
    ids=lambda value: value if isinstance(value, str) else value.rig,
)
def test_an_effect_is_fitted_without_given_numbers(case: Case, asked: str) -> None:
    campaign = recorded(case)
    own = effect_on(campaign.rig, case.effect, {e.name: e for e in CATALOGUE}, "the case")
    unknown = {p.name for p in own.parameters}
    campaign = replace(
        campaign,
        modelled=(),
        parameters={name: value for name, value in campaign.parameters.items() if name not in unknown},
    )
    effect = effect_named(asked.partition("@")[0])
    if "@" in asked:
        effect = placed(effect, asked.partition("@")[2])
    found = identify_campaign(campaign, BY_DEFAULT, effects=[effect])
    fit = found.joint.fit.fit
    for name in (name for name in case.truth if name not in campaign.constants):
        assert abs(fit.values[name] - case.truth[name]) < 4.0 * fit.standard_errors[name] < np.inf, name
    assert found.hysteresis is None
    assert len(found.model["effects"]) == 1


def test_numbers_of_an_effect_that_is_asked_for_are_fitted_anew() -> None:
    campaign = recorded(CASES[0])
    far = replace(campaign, parameters={**campaign.parameters, "T_c": 50.0})
    found = identify_campaign(far, BY_DEFAULT, effects=[effect_named("coulomb_friction")])
    assert found.joint.fit.fit.values["T_c"] == pytest.approx(CASES[0].truth["T_c"], rel=0.05)


def test_an_effect_begins_at_the_fit_of_a_simpler_one_beside_those_of_the_simulation() -> None:
    campaign = recorded(CASES[0])
    (friction,) = campaign.modelled
    alone = replace(campaign, modelled=())
    found = identify_campaign(alone, BY_DEFAULT, effects=[effect_named("stribeck_friction")])
    simpler = identify_campaign(alone, BY_DEFAULT, effects=[friction])
    assert found.joint.fit.noise["x"] <= simpler.joint.fit.noise["x"]
    both = identify_campaign(campaign, BY_DEFAULT, effects=[effect_named("input_delay")])
    assert sorted(both.model["effects"]) == ["coulomb_friction", "input_delay"]
    assert both.joint.fit.fit.values["T_c"] == pytest.approx(CASES[0].truth["T_c"], rel=0.01)


def test_effects_take_the_transfer_function_and_leave_the_response() -> None:
    for record in identify_campaign(recorded(CASES[0]), checked_options("h1", None)).records:
        assert record.motion.fit is None
        assert record.motion.measured is None or record.motion.measured.method.startswith("H1")


def test_a_campaign_that_starts_at_its_bounds(shared_data: Path) -> None:
    folder = shared_data.parent / "cases" / "fit_started_at_a_bound"
    if not folder.is_dir():
        pytest.skip(f"the cases of users are not at {folder}")
    found = identified(read_campaign(folder))
    fit = found.joint.fit.fit
    for name, value in {"m": 2.0, "d": 12.0, "k": 800.0, "T_c": 1.5}.items():
        assert fit.values[name] == pytest.approx(value, rel=1e-3), name
        assert abs(fit.values[name] - value) < 4.0 * fit.standard_errors[name], name
