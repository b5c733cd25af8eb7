"""A rig file that is right is read as it stands; one that is wrong ends in one message with its place."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import sympy as sp

from rigsight.errors import InputError
from rigsight.rigs import RIGS, read_rig_file, rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text

TRAIN = rig_file_text("drive_train")


def test_units_are_checked_although_the_same_rig_was_read_without() -> None:
    wrong = changed('unit = "N m s/rad"', 'unit = "N m/rad"')
    first = rig_of_text(wrong, check_units=False)
    with pytest.raises(InputError, match=r"joints\.shaft\.damping"):
        rig_of_text(wrong)
    assert rig_of_text(wrong, check_units=False) is first


@pytest.mark.parametrize("name", list(RIGS))
def test_units_of_built_in_rigs_add_up(name: str) -> None:
    assert rig_of_text(rig_file_text(name), name).name == name


def test_a_rig_is_read_as_it_stands() -> None:
    rig = rig_of_text(TRAIN)
    assert [signal.name for signal in rig.inputs] == ["u"]
    assert [(signal.name, signal.unit) for signal in rig.outputs] == [
        ("motor_angle", "rad"),
        ("load_angle", "rad"),
    ]
    assert [joint.name for joint in rig.mechanism.joints] == ["shaft", "motor_bearing", "load_bearing"]
    shaft = rig.mechanism.joints[0]
    phi_m, phi_l = sp.symbols("phi_m phi_l", real=True)
    assert shaft.motion == phi_m - phi_l
    assert shaft.stiffness == sp.Symbol("k_s", real=True)
    assert rig.constants[0].default == 0.05
    inertia = next(p for p in rig.parameters if p.name == "J_m")
    assert (inertia.logarithmic, inertia.lower, inertia.unit) == (True, 1e-9, "kg m^2")


def test_a_file_may_begin_with_the_mark_of_windows_editors(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_bytes(b"\xef\xbb\xbf" + TRAIN.encode())
    assert read_rig_file(file) is rig_of_text(TRAIN)


def test_an_integer_of_thousands_of_digits_is_refused() -> None:
    with pytest.raises(InputError, match=r"rig\.toml: contains an integer with too many digits"):
        rig_of_text(changed("default = 0.05", "default = " + 5000 * "1"), "rig.toml")


def test_a_control_law_reads_the_sensor() -> None:
    (drive,) = RIGS["servo"].mechanism.drives
    assert {symbol.name for symbol in drive.signal.free_symbols} == {"k_p", "goal", "reading of angle"}


def test_a_name_that_is_sensor_and_coordinate_is_the_sensor_in_a_control_law_alone() -> None:
    text = rig_file_text("axis").replace('signal = "u"', 'signal = "u - 3.7*x"')
    rig = rig_of_text(text)
    assert "reading of x" in {symbol.name for symbol in rig.mechanism.drives[0].signal.free_symbols}
    assert rig.mechanism.joints[0].motion == sp.Symbol("x", real=True)


def changed(old: str, new: str) -> str:
    assert old in TRAIN, old
    return TRAIN.replace(old, new, 1)


WRONG = {
    "no toml": ("name = ", "is not valid TOML"),
    "nothing": ("", "the line 'name = ...' is missing"),
    "key": (
        changed('stiffness = "k_s"', 'stifness = "k_s"'),
        "line 55, column 12.*'stifness'.*Did you mean 'stiffness'",
    ),
    "table": (TRAIN + "\n[joint.x]\n", "'joint' is not a key.*Did you mean 'joints'"),
    "key of an alternative": (
        rig_file_text("running_gear").replace('gives = "c_y"', 'give = "c_y"'),
        "'give' is not a key of this table. Did you mean 'gives'.* Allowed: .*gives, value",
    ),
    "name": (changed('"phi_m - phi_l"', '"phi_m - phi_1"'), "line 54, column 19.*'phi_1' is not declared"),
    "sum of units": (changed("J_l*d(phi_l)^2/2", "J_l*d(phi_l)/2"), "line 51.*are added"),
    "unit of a stiffness": (
        changed('stiffness = "k_s"', 'stiffness = "d_s"'),
        "line 55.*joints.shaft.stiffness.*kg m",
    ),
    "unknown unit": (changed('unit = "A"', 'unit = "foo"'), "line 5, column 8.*'foo' is unknown"),
    "no SI": (changed('[coordinates.phi_m]\nunit = "rad"', '[coordinates.phi_m]\nunit = "deg"'), "not SI"),
    "unused": (changed('\ndamping = "d_l"', ""), "parameters.d_l: no equation reads 'd_l'"),
    "still sensor": (changed('reads = "phi_l"', 'reads = "u/u"'), "it reads nothing that moves"),
    "loop": (
        TRAIN + '\n[signals]\na = "b*2"\nb = "a/2"\n',
        r"an algebraic loop \(no state in it\): a -> b -> a|b -> a -> b",
    ),
    "name taken": (
        TRAIN + '\n[states.k_s]\nrate = "1"\nunit = "1"\n',
        "'k_s' is already used by \\[parameters.k_s\\]",
    ),
    "code": (
        changed('signal = "u"', "signal = \"__import__('os')\""),
        "line 66, column 22.*is not allowed here",
    ),
    "log of zero": (changed("lower = 1e-9", "lower = 0.0"), "line 15, column 9.*above 0, got 0"),
    "default": (changed("lower = 0.0", "lower = 0.0\ndefault = -1.0"), "-1 is not within"),
    "drive without its signal": (changed('"k_t*motor"', '"k_t*u"'), "nor another equation reads 'motor'"),
    "number in quotes": (changed("default = 0.05", 'default = "0.05"'), "line 11, column 11.*got '0.05'"),
    "function as a name": (changed("[inputs.u]", "[inputs.sin]"), "'sin' is a function"),
    "rate of a number": (
        changed("J_l*d(phi_l)^2/2", "J_l*d(J_l)^2/2"),
        "no coordinate 'J_l'.* Coordinates: phi_m, phi_l",
    ),
    "power": (changed("d(phi_m)^2", "d(phi_m)**2"), "powers are written with \\^"),
    "prescribed": (
        changed("[coordinates.phi_m]", '[coordinates.phi_m]\nprescribed_by = "w"'),
        "no input 'w'",
    ),
    "no sensor": (TRAIN[: TRAIN.index("[sensors")], r"at least one \[sensors.NAME\]"),
    "force": (
        changed('"k_t*motor"', '"motor*k_t/k_t"'),
        "force times the expression that it acts along is in J",
    ),
    "nested": (changed('"k_s"', '"' + "(" * 100 + "k_s" + ")" * 100 + '"'), "nested 60 deep"),
    "no number": (changed("default = 0.05", "default = nan"), "finite number"),
    "list": (changed('signal = "u"', 'signal = ["u"]'), "line 66.*drives.motor.signal"),
    "start": (TRAIN + '\n[initial]\nphi_x = "1"\n', "'phi_x' is not a coordinate"),
    "unit of a rate": (
        TRAIN + '\n[states.z]\nrate = "phi_l - z"\nunit = "rad"\n',
        "should be in 1/s, from the unit of the state",
    ),
    "twice": (TRAIN + "\n[joints.shaft]\n", "is not valid TOML"),
    "linear energy": (changed("J_l*d(phi_l)^2/2", "J_l*d(phi_l)^2/2 + J_m*d(phi_m)*9.81"), "sum of squares"),
    "force fed back": (
        changed('signal = "u"', 'signal = "u - load/9.81"').replace(
            "[sensors.motor_angle]",
            '[sensors.load]\nreads = "force(shaft)"\nunit = "N m"\n[sensors.motor_angle]',
        ),
        "drives.motor.signal: it reads the force of a joint",
    ),
    "joint that never moves": (
        changed('motion = "phi_l"', 'motion = "phi_l - phi_l"'),
        "line 61, column 10: joints.load_bearing.motion: it reads no coordinate",
    ),
    "drive that moves nothing": (
        changed('along = "phi_m"', 'along = "0*phi_m"'),
        "line 68, column 9: drives.motor.along: .* no degree of freedom.*: phi_m, phi_l",
    ),
    "drive along a prescribed motion": (
        TRAIN.replace('along = "phi_m"', 'along = "turn"').replace(
            "[inputs.u]",
            '[coordinates.turn]\nunit = "rad"\nprescribed_by = "rolled"\n[inputs.rolled]\nunit = "rad"\n[inputs.u]',
        ),
        "drives.motor.along: .* no degree of freedom",
    ),
    "joint of a prescribed motion that no sensor reads": (
        rig_file_text("element").replace('reads = "force(dynamics)"', 'reads = "k*stroke + d*d(stroke)"'),
        r"joints.dynamics.motion: its motion is prescribed, and no sensor reads force\(dynamics\)",
    ),
    "no inertia": (changed(" + J_l*d(phi_l)^2/2", " + J_l*d(phi_m)^2/2"), "mass matrix is singular.*phi_l"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_message(case: str) -> None:
    text, reported = WRONG[case]
    with pytest.raises(InputError, match=r"rig\.toml") as caught:
        rig_of_text(text, "rig.toml")
    message = str(caught.value)
    assert re.search(reported, message), message
    assert "\n" not in message
    assert message.endswith(".") or "TOML" in message


def test_a_file_that_is_no_text_is_told(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(b'name = "\xff"')
    with pytest.raises(InputError, match="is not text in UTF-8"):
        read_rig_file(path)
