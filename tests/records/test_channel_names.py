"""What names of channels give away."""

from __future__ import annotations

import pytest

from rigsight.records.channel_names import closeness, split_unit


@pytest.mark.parametrize(
    ("name", "bare", "unit"),
    [
        ("Kraft [kN]", "Kraft", "kN"),
        ("Strom (A)", "Strom", "A"),
        ("Signal/Weg mm", "Signal/Weg", "mm"),
        ("pos_mm", "pos", "mm"),
        ("time_in_ms", "time", "ms"),
        ("speed_rad_s", "speed", "rad/s"),
        ("speed_in_per_s", "speed", "in/s"),
        ("turns_per_s", "turns_per_s", None),
        ("rate deg_per_s", "rate", "deg/s"),
        ("Winkel °", "Winkel", "°"),
        ("x", "x", None),
        ("x_a", "x_a", None),
        ("run 2", "run 2", None),
        ("[]", "[]", None),
        ("control[0]", "control[0]", None),
        ("data(:,1)", "data(:,1)", None),
        ("x [-]", "x [-]", None),
        ("speed [1/min]", "speed", "1/min"),
    ],
)
def test_units_in_names(name: str, bare: str, unit: str | None) -> None:
    assert split_unit(name) == (bare, unit)


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("u", "u"), ("Motor current [A]", "u"), ("MotorCurrent", "u"), ("Strom", "u"), ("log/u", "u"), ("Time_s", "t"),
        ("Zeit [ms]", "t"), ("Weg mm", "x"), ("Signal/Weg mm", "x"), ("Kraft [kN]", "force"), ("yaw angle", "psi"),
        ("Motor Angle [deg]", "motor_angle"), ("angle of the motor", "motor_angle"), ("log/pos_m", "pos_m"),
        ("Angle 1", "angle_1"), ("a1 torque cmd [Nm]", "u"), ("pwm", "u"), ("m2 torque", "u"), ("joint1 speed", "velocity"),
        ("q", "angle"), ("motor torque", "torque"),
    ],
)  # fmt: skip
def test_names_of_signals(name: str, signal: str) -> None:
    assert closeness(name, signal) >= 2.0


@pytest.mark.parametrize(
    ("name", "signal"), [("Temperatur", "t"), ("xylophone", "x"), ("", "u"), ("fs", "force")]
)
def test_names_that_only_look_alike(name: str, signal: str) -> None:
    assert closeness(name, signal) == 0.0


@pytest.mark.parametrize(("name", "signal"), [("motor", "motor_angle"), ("angle_2", "angle_1"), ("x", "_")])
def test_a_word_that_is_shared_is_a_hint_and_no_more(name: str, signal: str) -> None:
    assert closeness(name, signal) < 1.0
