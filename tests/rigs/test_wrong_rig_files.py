"""Twenty-five mistakes that people make in rig files: one message each, with its place and what to write instead."""

from __future__ import annotations

import pytest

from rigsight.errors import InputError
from rigsight.rigs import rig_file_text
from rigsight.rigs.reading.rig_file import rig_of_text

TRAIN = rig_file_text("drive_train")
MISTAKES = [
    ('signal = "u"', "signal = u", "line 66, column 10: is not valid TOML: Invalid value; put text and expressions in quotes."),
    ('stiffness = "k_s"', 'stiffness = "k_s', "line 55, column 17: is not valid TOML: .*quotation mark is missing at the end"),
    ('[parameters.J_m]\nunit = "kg m^2"', "[parameters.J_m]", r"line 13, column 1: parameters.J_m: the line 'unit = ...' is"),
    ("lower = 1e-9", 'lower = "1e-9"', "line 15, column 9: .* expected a number without quotes, as 0.05, got '1e-9'"),
    ("log = true", 'log = "yes"', "line 16, column 7: .* expected true or false without quotes, got 'yes'"),
    ("log = true", "log = true\nupper = 1e-12", "line 15, column 9: .* lower = 1e-09 is not below upper = 1e-12"),
    ('[coordinates.phi_m]\nunit = "rad"', '[coordinates]\nphi_m = "rad"', r"line 46, .* write \[coordinates.phi_m\] and"),
    ("[joints.shaft]", "[[joints.shaft]]", r"line 53, column 1: .*write \[joints.shaft\]"),
    ("[joints.shaft]", "[joint.shaft]", "line 53, column 1: joint: .*Did you mean 'joints'"),
    ("[joints.shaft]", "[joints.2nd]", "line 53, column 1: joints.2nd: '2nd' is not a name: use letters, digits and _"),
    ('damping = "d_m"', 'damping = "d_m*phi_m"', "line 59, column 16: .* the damping of a joint may contain parameters"),
    ('damping = "d_m"', 'force = "d_m*dphi_m"', r"line 59, column 14: .* 'dphi_m' is not declared. Did you mean 'd\(phi_m\)'"),
    ('damping = "d_m"', 'force = "d_m*d(phi)"', r"line 59, column 16: .*no coordinate 'phi'. Did you mean 'phi_m'"),
    ('damping = "d_m"', """force = "d_m*phi_m'\"""", r"line 59, column 19: .* a rate is written d\(phi\)"),
    ('damping = "d_m"', 'force = "d_m*sgn(d(phi_m))"', "line 59, column 14: .* no function 'sgn'. Did you mean 'sign'"),
    ('signal = "u"', 'signal = "clip(u, 1)"', r"line 66, column 11: .*clip takes 3 arguments, clip\(x, low, high\), and 2"),
    ('signal = "u"', 'signal = "2*(u - load_angle"', "line 66, column 27: .* ends too early"),
    ('signal = "u"', 'signal = "u + motor"', r"line 66, column 10: .* an algebraic loop \(no state in it\): motor -> motor"),
    ('"k_t*motor"', '"k_t*motor + force(shaft)"', r"line 67, column 28: .*'force\(shaft\)' can only be read by sensors"),
    ('reads = "phi_m"', 'reads = "force(shft)"', "line 71, column 16: .*no joint 'shft'. Did you mean 'shaft'"),
    ('reads = "phi_m"', 'reads = "d(phi_m)"', "line 71, column 9: .* in 1/s but should be without a unit .*, as its unit"),
    ("J_m*d(phi_m)^2/2", "-J_m*d(phi_m)^2/2", "line 51, column 11: .* negative when phi_m moves; change its sign"),
    ("J_l*d(phi_l)^2/2", "J_l*d(phi_l)^2/2 + k_s*phi_l^2/2", "terms without a rate belong to the potential energy"),
    ("J_l*d(phi_l)^2/2", "J_l*(d(phi_m) - d(phi_l))^2/2 - J_m*d(phi_m)^2/2", "phi_m, phi_l can move together without energy"),
    ("[coordinates.phi_m]", '[coordinates.phi_m]\nrate = "k_s"', r"line 46, column 8: .* 'k_s' is already used by \[parameters"),
    ("[coordinates.phi_m]", '[coordinates.phi_m]\nprescribed_by = "k_t"', "line 46, column 17: .* no input 'k_t'. Declared: u"),
    ("[sensors.motor_angle]", "[sensors.shaft]", r"line 70, column 1: .*\[joints.shaft\] has the same name"),
    ('unit = "A"', 'unit = "mA"', "line 5, column 8: .* 'mA' is not SI: equations are in A"),
    ('unit = "A"', 'unit = "degC"', "line 5, column 8: .* 'degC' is not SI: equations are in K, which has another zero"),
    ('"k_s"', '"k_s*log(-1)"', "line 55, column 18: .*no real value"),
    ('"k_s"', '"k_s^1e9"', "line 55, column 18: .*an exponent must be within"),
    ('"k_s"', '"' + "k_s+" * 1300 + 'k_s"', "line 55, column 13: .* it may have at most 5000 characters but has 5203"),
    ('name = "drive_train"', 'name = ""', "line 1, column 8: name: expected at least one character"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "reported"), MISTAKES)
def test_a_mistake_is_one_message_with_its_place_and_mend(old: str, new: str, reported: str) -> None:
    assert old in TRAIN
    with pytest.raises(InputError, match=reported) as caught:
        rig_of_text(TRAIN.replace(old, new, 1), "rig.toml")
    message = str(caught.value)
    assert message.startswith("rig.toml, line ")
    assert "\n" not in message
    assert message.endswith(".")
    assert not message.endswith("..")


ALTERNATIVES = [
    ('gives = "c_y"', 'gives = "c_x"', "no parameter 'c_x'. Did you mean 'c_y'"),
    ('value = "cos(', 'value = "c_y*cos(', "'c_y' .*the derived value may contain 'delta_0' and constants"),
    ("*sin(delta_0)*cos(delta_0)", "*sin(delta_0)*cos(delta_1)", "'delta_1' is not declared. Did you mean 'delta_0'"),
    ('"cos(delta_0)^2 - 2*r_0/b*sin(delta_0)*cos(delta_0)"', '"2*r_0/b"', "it does not read 'delta_0'"),
    ('stiffness = "k_c"', 'stiffness = "delta_0*k_c"', "'delta_0' is an alternative to 'c_y'; use that one"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "reported"), ALTERNATIVES)
def test_an_alternative_follows_from_itself_and_constants(old: str, new: str, reported: str) -> None:
    text = rig_file_text("running_gear")
    assert old in text
    with pytest.raises(InputError, match=reported):
        rig_of_text(text.replace(old, new, 1), "rig.toml")


@pytest.mark.parametrize(
    "formula",
    [
        "(" * 60 + "k_s" + ")" * 60,
        "k_s" + "+k_s" * 1200,
        "k_s" + "*1" * 2000,
        "-" * 118 + "k_s",
    ],
)
def test_long_expressions_are_read(formula: str) -> None:
    assert (
        rig_of_text(TRAIN.replace('stiffness = "k_s"', f'stiffness = "{formula}"', 1)).name == "drive_train"
    )


@pytest.mark.parametrize(
    "formula",
    [
        "k_s*((((k_s^20)^20)^20)^20)^20",
        "-" * 4000 + "k_s",
        "k_s" + "^k_s" * 900,
        "((((k_s^20)^20)^20)^20)^20",
        "((((((9^20)^20)^20)^20)^20)^20)*k_s",
        "exp(exp(exp(10)))*k_s",
        "k_s^(10^19)",
        "1e400*k_s",
        "9" * 4000 + "*k_s",
        "sqrt(-1)*k_s",
        "k_s*atan2(0, 0)",
        "k_s/(J_m - J_m)",
        "max(log(-1), k_s)",
    ],
)
def test_what_leaves_the_range_of_numbers_is_one_message(formula: str) -> None:
    with pytest.raises(InputError, match="line 55, column"):
        rig_of_text(TRAIN.replace('stiffness = "k_s"', f'stiffness = "{formula}"', 1), "rig.toml")


def test_newton_meters_may_be_written_as_one_word() -> None:
    assert rig_of_text(TRAIN.replace('"N m s/rad"', '"Nm s/rad"')).name == "drive_train"


@pytest.mark.parametrize("unit", ["a" * 60 + "!", "m" * 59 + "^", "(" * 30 + ")" * 30, "m^9^9", "1/0"])
def test_no_unit_takes_long_to_be_refused(unit: str) -> None:
    with pytest.raises(InputError, match="unit"):
        rig_of_text(TRAIN.replace('unit = "A"', f'unit = "{unit}"', 1), "rig.toml")
