"""The smallest size that would have been named holds for records with such an effect in them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, effect_named
from rigsight.errors import InputError
from rigsight.inverse import propose
from rigsight.records import Record
from rigsight.rigs import AXIS
from rigsight.simulate import compose, simulate
from rigsight.workflow.own.own_effects import candidates_of
from rigsight.workflow.power import Power, power_of

VALUES = {"gain": 1.0, "m": 2.0, "d": 12.0, "k": 800.0, "x_off": 0.0, "force_off": 0.0}
NOISE = 2e-5


def campaign(friction: float = 0.0) -> Campaign:
    """Return sweeps of an axis with small ripples of its drive that its equations do not have."""
    rng, t = np.random.default_rng(0), 0.005 * np.arange(4000)
    structure = compose(AXIS, [effect_named("coulomb_friction")])
    records = []
    for i, amplitude in enumerate((10.0, 20.0)):
        u = amplitude * np.sin(i + 2.0 * np.pi * (0.3 * t + 0.1 * t**2))
        ripple = u + 0.2 * np.sin(9.0 * t + i)
        run = simulate(structure, {**VALUES, "T_c": friction}, Record(f"run {i}", 0.005, {"u": ripple}, {}))
        records.append(run.with_signals(u=u, x=run["x"] + NOISE * rng.standard_normal(t.size)))
    given = {name: value for name, value in VALUES.items() if name != "gain"}
    return Campaign("axis", AXIS, {"gain": 1.0}, given, tuple(records))


def families(friction: float) -> set[str]:
    own = campaign(friction)
    found = propose(own, VALUES, candidates_of(own, CATALOGUE))
    assert found is not None
    return {str(cause.family) for cause in found.taken}


@pytest.fixture(scope="module")
def power() -> Power:
    names = ("coulomb_friction", "flexible_mode", "periodic_disturbance")
    return power_of(campaign(), [effect_named(name) for name in names])


def test_friction_of_twice_the_size_is_found_in_records_and_a_quarter_is_not(power: Power) -> None:
    friction = power.sizes[0]
    value, unit = friction.parameters["T_c"]
    assert unit == "N"
    assert "dry_friction" in families(2.0 * value)
    assert "dry_friction" not in families(0.25 * value)


def test_what_the_motion_does_not_judge_has_a_reason_in_place_of_a_size(power: Power) -> None:
    entries = json.loads(json.dumps(power.to_json(), allow_nan=False))["effects"]
    assert entries[0]["size"]["parameter"] == "T_c"
    assert entries[0]["reason"] is None
    assert entries[1]["size"] is None
    assert "Not judged" in entries[1]["reason"]
    assert "already" in entries[2]["reason"], "the ripple of the drive is a tone"


def test_records_that_do_not_show_the_motion_are_refused() -> None:
    own = campaign()
    blind = Campaign("axis", AXIS, own.constants, own.given, own.estimation, (effect_named("sensor_delay"),))
    with pytest.raises(InputError, match="do not show the whole motion"):
        power_of(blind)


def test_an_effect_that_the_simulation_has_is_listed_with_that_reason() -> None:
    own, friction = campaign(), effect_named("coulomb_friction")
    with_friction = Campaign(
        "axis", AXIS, own.constants, {**own.given, "T_c": 0.1}, own.estimation, (friction,)
    )
    (entry,) = power_of(with_friction, [friction]).sizes
    assert entry.parameters == {}
    assert "already" in entry.reason
