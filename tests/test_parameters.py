"""A parameter keeps its range; a set of them keeps their order."""

from __future__ import annotations

import dataclasses

import pytest

from rigsight.errors import InputError
from rigsight.parameters import Parameter, ParameterSet

MASS = Parameter("m", "moving mass", unit="kg", lower=0.1, upper=10.0)
DAMPING = Parameter("d", "damping", unit="N s/m", lower=0.0)
STIFFNESS = Parameter("k", "stiffness", unit="N/m", lower=0.0)
ALL = (MASS, DAMPING, STIFFNESS)


@pytest.fixture
def values() -> ParameterSet:
    return ParameterSet.from_mapping(ALL, {"k": 100.0, "m": 2.0, "d": 0.5})


def test_the_bounds_belong_to_the_range() -> None:
    assert MASS.check(0.1) == 0.1
    assert MASS.check(10.0) == 10.0


@pytest.mark.parametrize("value", [0.0999, 10.001, float("nan"), float("inf")])
def test_outside_the_range_the_error_names_parameter_value_and_unit(value: float) -> None:
    with pytest.raises(InputError, match=r"'m'.*kg") as caught:
        MASS.check(value)
    assert f"{value:g}"[:3] in str(caught.value)


def test_values_have_the_order_of_the_parameters_not_of_the_mapping(values: ParameterSet) -> None:
    assert values.values == (2.0, 0.5, 100.0)
    assert values.names == ("m", "d", "k")
    assert [(p.name, v) for p, v in values] == [("m", 2.0), ("d", 0.5), ("k", 100.0)]


def test_mapping_and_set_are_inverse(values: ParameterSet) -> None:
    assert ParameterSet.from_mapping(ALL, values.to_mapping()) == values


def test_missing_and_unknown_names_are_listed() -> None:
    with pytest.raises(InputError, match=r"Missing.*m.*k"):
        ParameterSet.from_mapping(ALL, {"d": 0.5})
    with pytest.raises(InputError, match=r"mm.*Known: m, d, k"):
        ParameterSet.from_mapping(ALL, {"mm": 1.0, "m": 1.0, "d": 0.5, "k": 1.0})


def test_replace_gives_a_new_set_and_checks_it(values: ParameterSet) -> None:
    stiffer = values.replace(k=200.0)
    assert (stiffer["k"], stiffer["m"], values["k"]) == (200.0, 2.0, 100.0)
    with pytest.raises(InputError, match="'m'"):
        values.replace(m=-1.0)
    with pytest.raises(InputError, match="Unknown"):
        values.replace(mass=1.0)


def test_a_set_cannot_be_changed(values: ParameterSet) -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        values.values = (1.0, 2.0, 3.0)  # type: ignore[misc]
