"""Which effects can a motion not show, whatever the equations leave?"""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.campaign import Campaign
from rigsight.diagnose.fit_context import candidates_on
from rigsight.effects import CATALOGUE, Family, effect_named, kind_of
from rigsight.inverse import hidden_effects, propose
from rigsight.records import Record
from rigsight.rigs import AXIS, Rig
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate

from .motor_rig import TEXT, motor_rig

SHOWS_ANGLE = motor_rig("J*d(q)^2/2")
SHOWS_SPEED = rig_of_text(
    TEXT.format(kinetic="J*d(q)^2/2", potential="0", constants="").replace(
        '[sensors.angle]\nreads = "q"\nunit = "rad"', '[sensors.speed]\nreads = "d(q)"\nunit = "rad/s"'
    ),
    "motor.toml",
)
COUNTED = TEXT.format(kinetic="J*d(q)^2/2", potential="0", constants="").replace(
    '[sensors.angle]\nreads = "q"\nunit = "rad"', '[sensors.speed]\nreads = "abs(d(q))"\nunit = "rad/s"'
)
OF_POSITION = {"cubic_stiffness", "gravity_pendulum", "end_stop", "position_dependent_damping"}
VALUES = {"J": 2e-3, "k_v": 0.6, "d": 0.02, "T_c": 0.05}
DT = 5e-3


@pytest.mark.parametrize(
    ("rig", "means", "hidden"),
    [
        (SHOWS_ANGLE, (0.0,), set()),
        (SHOWS_ANGLE, (0.5, 0.6), {"directional_damping"}),
        (SHOWS_ANGLE, (0.5, -0.5), set()),
        (SHOWS_SPEED, (0.0,), OF_POSITION),
        (SHOWS_SPEED, (0.5,), {*OF_POSITION, "directional_damping"}),
    ],
)
def test_a_force_over_an_unknown_position_and_a_difference_of_directions_in_one_are_hidden(
    rig: Rig, means: tuple[float, ...], hidden: set[str]
) -> None:
    t = DT * np.arange(2000)
    structure, wave = compose(rig, [effect_named("coulomb_friction")]), 0.3 * np.sin(3.0 * t)
    runs = [
        simulate(structure, VALUES, Record(f"run {mean}", DT, {"u": mean + wave}, {}, hold="foh"))
        for mean in means
    ]
    found = propose(Campaign("motor", rig, {}, {}, tuple(runs)), VALUES, candidates_on(rig, CATALOGUE))
    assert found is not None
    asked = {*OF_POSITION, "directional_damping", "flexible_mode", "torque_ripple"}
    assert asked & set(map(kind_of, found.hidden)) == hidden
    assert found.taken[0].family == "dry_friction"


def test_what_a_motion_cannot_show_does_not_depend_on_effects_that_are_modelled() -> None:
    """Beside a bridge that coasts nothing is asked along the motion, and a wheel still turns freely."""
    t = DT * np.arange(2000)
    bridge = effect_named("coasting_bridge")
    record = Record("run", DT, {"u": 0.3 * np.sin(3.0 * t)}, {}, hold="foh")
    run = simulate(compose(SHOWS_SPEED, [bridge]), {**VALUES, "c_b": 0.1}, record)
    campaign = Campaign("motor", SHOWS_SPEED, {}, {}, (run,), (bridge,))
    offered = candidates_on(SHOWS_SPEED, CATALOGUE, campaign.modelled)
    assert propose(campaign, {**VALUES, "c_b": 0.1}, offered) is None
    assert set(map(kind_of, hidden_effects(campaign, VALUES, offered))) >= OF_POSITION
    # Magnitudes of the speed do not show the motion.
    counted = rig_of_text(COUNTED, "motor.toml")
    rectified = Campaign("motor", counted, {}, {}, (run.with_signals(speed=np.abs(run["speed"])),))
    assert propose(rectified, VALUES, candidates_on(counted, CATALOGUE)) is None
    hidden = set(map(kind_of, hidden_effects(rectified, VALUES, candidates_on(counted, CATALOGUE))))
    assert hidden == {*OF_POSITION, "asymmetric_stiffness", "power_law_stiffness"}


def test_a_free_motion_that_is_read_later_is_another_one_of_the_same_equations() -> None:
    t = DT * np.arange(2000)
    values = {"gain": 1.0, "m": 1.0, "d": 0.5, "k": 100.0, "x_off": 0.0, "force_off": 0.0, "T_c": 0.5}
    structure = compose(AXIS, [effect_named("coulomb_friction")])
    run = simulate(structure, values, Record("decay", DT, {"u": 0.0 * t}, {}), np.array([0.3, 0.0]))
    own = Campaign("axis", AXIS, {"gain": 1.0}, {}, (run,))
    found = propose(own, values, candidates_on(AXIS, CATALOGUE))
    assert found is not None
    late = {e.name for e in candidates_on(AXIS, CATALOGUE) if e.family is Family.DELAY_OR_LAG}
    assert late <= found.hidden
    assert found.alone[0].family == "dry_friction"
