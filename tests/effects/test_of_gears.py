"""Effects of gears: friction that depends on loads, and a gear that gives way, beside the rigs that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from rigsight.effects import effect_named, placed
from rigsight.records import Record
from rigsight.rigs import RIGS, Rig
from rigsight.rigs.reading.rig_file import rig_of_tables, rig_of_text
from rigsight.simulate import compose, simulate

SERVO = RIGS["servo"]
VALUES = {"m": 1.0, "l": 0.15, "k_p": 2.0, "J": 0.01, "k_v": 3.0, "d": 0.5, "angle_off": 0.0}
DT = 0.004
T = DT * np.arange(1500)
GOAL = Record("goal", DT, {"goal": 0.6 * np.sin(2.0 * np.pi * (0.2 * T + 0.15 * T**2))}, {}, hold="foh")
RIGID = """
name = "rigid"
summary = "A rotor and a link that turn as one."
[inputs.goal]
unit = "rad"
[constants.J_l]
unit = "kg m^2"
default = 0.02
[parameters.J_r]
unit = "kg m^2"
lower = 1e-9
[parameters.k_p]
unit = "N m/rad"
lower = 0.0
[parameters.d]
unit = "N m s/rad"
lower = 0.0
[coordinates.q]
unit = "rad"
[energy]
kinetic = "(J_r + J_l)*d(q)^2/2"
[joints.gearbox]
motion = "q"
damping = "d"
[drives.motor]
signal = "k_p*(goal - angle)"
force = "motor"
along = "q"
[sensors.angle]
reads = "q"
unit = "rad"
"""
FLEXIBLE = (
    RIGID.replace('kinetic = "(J_r + J_l)*d(q)^2/2"', 'kinetic = "J_r*d(q)^2/2 + J_l*d(s)^2/2"')
    + """
[coordinates.s]
unit = "rad"
[constants.k_g]
unit = "N m/rad"
default = 8.0
[constants.d_g]
unit = "N m s/rad"
default = 0.04
[joints.gear]
motion = "q - s"
stiffness = "k_g"
damping = "d_g"
"""
)


def moved(rig: Rig, values: dict[str, float], name: str | None = None, **own: float) -> np.ndarray:
    effects = [] if name is None else [placed(effect_named(name), "gearbox")]
    structure = compose(rig, effects)
    named = {structure.parameter_name(effects[0], key): value for key, value in own.items()}
    return simulate(structure, {**values, **named}, GOAL, accuracy=1e-7)["angle"]


def test_one_coefficient_for_motor_and_load_is_load_dependent_friction() -> None:
    one = moved(SERVO, VALUES, "load_dependent_friction", T_c=0.05, mu=0.1)
    both = moved(SERVO, VALUES, "back_driving_friction", T_c=0.05, mu_m=0.1, mu_e=0.1)
    other = moved(SERVO, VALUES, "back_driving_friction", T_c=0.05, mu_m=0.05, mu_e=0.15)
    assert both == pytest.approx(one, abs=1e-6)
    assert np.std(other - one) > 1e-3


@pytest.mark.parametrize(
    ("name", "simpler", "own"),
    [
        ("load_dependent_stribeck_friction", "load_dependent_friction", {"T_c": 0.05, "mu": 0.1}),
        ("lugre_friction", "presliding_friction", {"T_c": 0.2, "x_p": 0.02}),
    ],
)
def test_without_an_excess_at_standstill_it_is_the_simpler_form(
    name: str, simpler: str, own: dict[str, float]
) -> None:
    plain = moved(SERVO, VALUES, simpler, **own)
    assert moved(SERVO, VALUES, name, **own, s=0.0, w_s=0.1) == pytest.approx(plain, abs=1e-6)
    assert np.std(moved(SERVO, VALUES, name, **own, s=1.0, w_s=0.1) - plain) > 1e-4


def test_a_limit_of_the_force_that_is_not_reached_leaves_the_motion_under_loaded_friction() -> None:
    # To find out whether the friction sticks took minutes where its load is limited.
    def motion(force: str) -> np.ndarray:
        motor = {**SERVO.declaration["drives"]["motor"], "force": force}
        tables = {**SERVO.declaration, "drives": {"motor": motor}, "joints": {"gearbox": {"motion": "q"}}}
        rig = rig_of_tables(tables, "servo.toml")
        return moved(rig, VALUES, "load_dependent_friction", T_c=0.05, mu=0.1)

    free, limited = (
        motion(force) for force in ("k_v*motor - d*d(q)", "clip(k_v*motor - d*d(q), -1e3*m, 1e3*m)")
    )
    assert limited == pytest.approx(free, abs=1e-6)


def test_friction_of_motor_and_load_needs_both() -> None:
    friction = effect_named("back_driving_friction")
    assert SERVO.offers(placed(friction, "gearbox"))
    assert not rig_of_text(RIGID, "rigid.toml").offers(placed(friction, "gearbox"))


def test_a_flexible_gear_moves_as_rotor_and_link_with_a_spring_between_them() -> None:
    values = {"J_r": 0.01, "k_p": 3.0, "d": 0.15, "J_l": 0.02}
    two_masses = moved(rig_of_text(FLEXIBLE, "flexible.toml"), {**values, "k_g": 8.0, "d_g": 0.04})
    w_a = (8.0 / 0.02) ** 0.5
    share, ratio = 0.02 / 0.03, 0.04 / (2.0 * w_a * 0.02)
    one = moved(rig_of_text(RIGID, "rigid.toml"), values, "flexible_gear", r=share, w_a=w_a, zeta_a=ratio)
    stiff = moved(rig_of_text(RIGID, "rigid.toml"), values)
    assert one == pytest.approx(two_masses, abs=1e-5 * np.ptp(two_masses))
    assert np.std(stiff - two_masses) > 1e-2 * np.std(two_masses)


def test_a_flexible_gear_is_offered_where_a_part_of_the_inertia_is_known() -> None:
    gear = effect_named("flexible_gear")
    assert rig_of_text(RIGID, "rigid.toml").offers(placed(gear, "gearbox"))
    assert not RIGS["axis"].offers(gear)
    assert not RIGS["drive_train"].offers(placed(gear, "shaft"))
