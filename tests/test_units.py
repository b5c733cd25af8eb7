"""Units and sizes of products of powers."""

from __future__ import annotations

import pytest

from rigsight.units import behind, characteristic_value, parse_dimension, unit_text

UNITS = {"force": "N m", "x": "rad", "time": "s", "input": "A", "length": "m", "share": "1"}


def test_exponents_of_repeated_quantities_add_up() -> None:
    assert parse_dimension("force time^2 x^-1 time") == {"force": 1, "time": 3, "x": -1}
    assert parse_dimension("") == {}


@pytest.mark.parametrize(
    ("dimension", "unit"),
    [
        ("", "1"),
        ("time", "s"),
        ("force x^-1", "N m/rad"),
        ("force x^-3", "N m/rad^3"),
        ("force time x^-1", "N m s/rad"),
        ("force time^2 x^-2", "N m s^2/rad^2"),
        ("x^-1", "1/rad"),
        ("force x^-1 time^-1", "N m/(rad s)"),
        ("force^2", "(N m)^2"),
        ("x force^-1", "rad/(N m)"),
        ("share x", "rad"),
        ("share", "1"),
        ("x x^-1", "1"),
    ],
)
def test_unit_text(dimension: str, unit: str) -> None:
    assert unit_text(dimension, UNITS) == unit


def test_a_quantity_without_a_unit_is_an_error() -> None:
    with pytest.raises(KeyError, match="mass"):
        unit_text("mass", UNITS)


def test_characteristic_value_is_the_product_of_powers() -> None:
    scales = {"force": 6.0, "x": 0.5, "time": 0.1}
    assert characteristic_value("force x^-3", scales) == pytest.approx(48.0, rel=1e-14)
    assert characteristic_value("force time^2 x^-1", scales) == pytest.approx(0.12, rel=1e-14)
    assert characteristic_value("", scales) == 1.0


def test_characteristic_values_obey_the_equation_of_motion() -> None:
    """Rescaling time, displacement and force rescales every term of m x'' + d x' + k x + k_3 x^3 = F alike."""
    scales = {"force": 3.0, "x": 0.02, "time": 0.4}
    x, t, force = scales["x"], scales["time"], scales["force"]
    rates = {"force time^2 x^-1": x / t**2, "force time x^-1": x / t, "force x^-1": x, "force x^-3": x**3}
    for dimension, rate in rates.items():
        assert characteristic_value(dimension, scales) * rate == pytest.approx(force, rel=1e-12)


def test_a_number_is_followed_by_its_unit_where_it_has_one() -> None:
    assert [f"2{behind(unit)}" for unit in ("N m", "", "1", "input")] == ["2 N m", "2", "2", "2"]
