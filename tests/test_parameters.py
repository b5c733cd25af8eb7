"""A parameter keeps its range; values keep the order of the parameters."""

from __future__ import annotations

import pytest

from rigsight.errors import InputError
from rigsight.parameters import Parameter, complete_values

MASS = Parameter("m", "moving mass", unit="kg", lower=0.1, upper=10.0)
DAMPING = Parameter("d", "damping", unit="N s/m", lower=0.0)
STIFFNESS = Parameter("k", "stiffness", unit="N/m", lower=0.0)
ALL = (MASS, DAMPING, STIFFNESS)


def test_the_bounds_belong_to_the_range() -> None:
    assert MASS.check(0.1) == 0.1
    assert MASS.check(10.0) == 10.0


@pytest.mark.parametrize("value", [0.0999, 10.001, float("nan"), float("inf")])
def test_outside_the_range_the_error_names_parameter_value_and_unit(value: float) -> None:
    with pytest.raises(InputError, match=r"'m'.*kg") as caught:
        MASS.check(value)
    assert f"{value:g}"[:3] in str(caught.value)


def test_values_have_the_order_of_the_parameters_and_their_defaults() -> None:
    k_3 = Parameter("k_3", "stiffening", default=0.0)
    found = complete_values((*ALL, k_3), {"k": 100.0, "m": 2.0, "d": 0.5})
    assert list(found.items()) == [("m", 2.0), ("d", 0.5), ("k", 100.0), ("k_3", 0.0)]
    with pytest.raises(InputError, match="'m'"):
        complete_values(ALL, {"k": 100.0, "m": -1.0, "d": 0.5})


def test_missing_and_unknown_names_are_listed() -> None:
    with pytest.raises(InputError, match=r"Missing.*m.*k"):
        complete_values(ALL, {"d": 0.5})
    with pytest.raises(InputError, match=r"mm.*Known: m, d, k"):
        complete_values(ALL, {"mm": 1.0, "m": 1.0, "d": 0.5, "k": 1.0})
