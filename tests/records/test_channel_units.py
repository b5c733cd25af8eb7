"""Units as files and people write them."""

from __future__ import annotations

import math

import pytest

from rigsight.errors import InputError
from rigsight.records import ColumnMapping
from rigsight.records.channel_units import UnknownUnitError, conversion, factor, is_unit, si_mapping


@pytest.mark.parametrize(
    ("unit", "si", "expected"),
    [
        ("A", "A", 1.0),
        ("mA", "A", 1e-3),
        ("deg", "rad", math.pi / 180),
        ("°", "rad", math.pi / 180),
        ("mrad", "rad", 1e-3),
        ("mm", "m", 1e-3),
        ("µm", "m", 1e-6),
        ("μm", "m", 1e-6),
        ("um", "m", 1e-6),
        ("in", "m", 0.0254),
        ("kN", "N", 1e3),
        ("KN", "N", 1e3),
        ("kg m/s²", "N", 1.0),
        ("kgf", "N", 9.80665),
        ("Nm", "N m", 1.0),
        ("kNm", "N m", 1e3),
        ("N·m", "N m", 1.0),
        ("ms", "s", 1e-3),
        ("min", "s", 60.0),
    ],
)
def test_known_units(unit: str, si: str, expected: float) -> None:
    assert factor(unit, si) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("unit", ["A", "mA", "ms", "mm", "kN", "m", "N"])
def test_powers_of_ten_are_exact(unit: str) -> None:
    si = {"A": "A", "s": "s", "m": "m", "N": "N"}[unit[-1]]
    assert factor(unit, si) == {"m": 1e-3, "k": 1e3}.get(unit[:-1], 1.0)


@pytest.mark.parametrize(
    ("unit", "si"),
    [
        ("mm", "rad"),
        ("%", "rad"),
        ("1", "rad"),
        ("rad", "m"),
        ("Nm", "N"),
        ("Grad", "rad"),
        ("grad", "rad"),
        ("degC", "m"),
        ("counts", "A"),
        ("furlongs per", "m"),
        ("m**999999999", "m"),
        ("9**9**9**9", "m"),
        ("__import__('os')", "m"),
        ("m" * 200, "m"),
        ("", "m"),
    ],
)
def test_what_is_no_unit_of_the_quantity_is_refused(unit: str, si: str) -> None:
    with pytest.raises(UnknownUnitError):
        factor(unit, si)


def test_the_message_says_what_to_write() -> None:
    with pytest.raises(InputError) as caught:
        si_mapping("run.mf4", "psi", "rad", ColumnMapping("Winkel"), "Winkel", "Grad")
    for part in (
        "run.mf4",
        "'Winkel'",
        "'Grad'",
        "stated in the file",
        "write deg",
        'unit = "..."',
        "scale = 1.0",
    ):
        assert part in str(caught.value)


def test_scale_and_unit_exclude_each_other() -> None:
    with pytest.raises(InputError, match="give one of the two"):
        ColumnMapping("u", scale=1.0, unit="mA")


def test_a_drive_may_be_given_in_any_unit_of_drives() -> None:
    mapping, notes = si_mapping("run.mat", "u", "input", ColumnMapping("F", unit="kN"), "F", None)
    assert (mapping.scale, notes) == (1000.0, ())
    with pytest.raises(InputError, match=r"not a unit of a drive \(A, V, N, N m\)"):
        si_mapping("run.mat", "u", "input", ColumnMapping("F", unit="mm"), "F", None)


def test_a_unit_in_a_name_that_is_not_read_is_asked_about() -> None:
    mapping, (note,) = si_mapping("run.mat", "t", "s", ColumnMapping("t_ms"), "t_ms", None)
    assert not mapping.is_converted
    assert 't = { name = "t_ms", unit = "ms" }' in note
    for said in (ColumnMapping("t_ms", unit="ms"), ColumnMapping("t_ms", scale=1.0)):
        assert si_mapping("run.mat", "t", "s", said, "t_ms", None)[1] == ()
    for name in ("t", "time_s", "Time [s]", "x_A"):
        assert si_mapping("run.mat", "t", "s", ColumnMapping(name), name, None)[1] == ()


def test_a_unit_of_the_campaign_that_contradicts_the_column_is_told() -> None:
    _, (note,) = si_mapping("run.csv", "t", "s", ColumnMapping("Time [s]", unit="ms"), "Time [s]", None)
    assert "taken in ms, as stated in the campaign, although its name ends with s." in note
    _, (note,) = si_mapping("run.mf4", "x", "m", ColumnMapping("x", unit="mm"), "x", "um")
    assert "though the file states um" in note


@pytest.mark.parametrize(
    ("unit", "si", "scale", "offset"),
    [
        ("degC", "K", 1.0, 273.15),
        ("°C", "K", 1.0, 273.15),
        ("degF", "K", 5 / 9, 459.67 * 5 / 9),
        ("N/degC", "N/K", 1.0, 0.0),
        ("mm", "m", 1e-3, 0.0),
    ],
)
def test_temperatures_are_converted_with_their_offset(
    unit: str, si: str, scale: float, offset: float
) -> None:
    assert conversion(unit, si) == pytest.approx((scale, offset), rel=1e-14)


def test_the_offset_of_a_temperature_is_told() -> None:
    stated, (note,) = si_mapping("run.mf4", "T", "K", ColumnMapping("T"), "T", "degC")
    assert (stated.scale, stated.offset) == (1.0, 273.15)
    assert "converted from degC, the unit stated in the file, to K. 273.15 K was added" in note
    assert "difference of temperatures, write scale = 1" in note
    asked, (note,) = si_mapping("run.csv", "T", "K", ColumnMapping("T", unit="degC"), "T", None)
    assert (asked.scale, asked.offset) == (1.0, 273.15)
    assert "taken in degC. 273.15 K was added" in note


def test_a_logarithmic_unit_is_not_converted() -> None:
    with pytest.raises(UnknownUnitError, match="is logarithmic"):
        factor("dB", "1")
    assert is_unit("dB")


def test_an_offset_alone_leaves_the_unit_of_the_file() -> None:
    mapping, (note,) = si_mapping("run.mf4", "x", "m", ColumnMapping("pos", offset=-0.1), "pos", "mm")
    assert (mapping.scale, mapping.offset) == (1e-3, -0.1)
    assert "converted from mm, the unit stated in the file, to m; the offset -0.1 m was added" in note
    as_given, notes = si_mapping(
        "run.mf4", "x", "m", ColumnMapping("pos", scale=1.0, offset=-0.1), "pos", "mm"
    )
    assert (as_given.scale, as_given.offset, notes) == (1.0, -0.1, ())


def test_beside_an_offset_a_message_names_only_the_scale() -> None:
    mapping, (note,) = si_mapping("run.csv", "x", "m", ColumnMapping("x_mm", offset=-0.1), "x_mm", None)
    assert (mapping.scale, mapping.offset) == (None, -0.1)
    assert "write scale = 0.001 beside the offset" in note
    with pytest.raises(InputError, match=r"'Grad', stated in the file, .* Write scale = 1.0 to take"):
        si_mapping("run.mf4", "psi", "rad", ColumnMapping("psi", offset=0.1), "psi", "Grad")
