"""Numbers of declared expressions: the thesis's formulas come out of the declaration."""

from __future__ import annotations

import pytest
import sympy as sp

from rigsight.errors import InputError
from rigsight.rigs import AXIS, RUNNING_GEAR, evaluated
from rigsight.rigs.reading.expressions import parsed, to_sympy

CONSTANTS = {"v": 1.0, "r_0": 0.1, "b": 0.3, "k_tau": 0.27}


def test_the_drive_of_the_running_gear_is_the_thesis_s():
    assert evaluated(RUNNING_GEAR.motion.drive_gain, CONSTANTS) == 0.3 * 0.27 / 0.1


def test_an_axis_is_driven_by_its_gain_alone():
    assert evaluated(AXIS.motion.drive_gain, {"gain": 3.5}) == 3.5


def test_nothing_creeps_where_the_lateral_displacement_rests():
    rolling = RUNNING_GEAR.follower
    assert rolling is not None
    at_rest = rolling.symbol + rolling.static_gain * RUNNING_GEAR.motion.displacement
    (offset,) = (s for s in rolling.displacement.free_symbols if s != rolling.symbol)
    creepage = rolling.creepage.subs(rolling.symbol, at_rest.subs(rolling.symbol, offset))
    assert sp.simplify(creepage) == 0


def test_a_name_without_a_number_is_an_error():
    with pytest.raises(KeyError, match="k_tau"):
        evaluated(RUNNING_GEAR.motion.drive_gain, {"b": 1.0, "r_0": 1.0})


@pytest.mark.parametrize(("value", "number"), [(-2.0, 0.0), (3.0, 3.0)])
def test_kinks_have_numbers(value: float, number: float) -> None:
    (a,) = sp.symbols("a,", real=True)
    assert evaluated(to_sympy(parsed("max(a, 0)"), {"a": a}), {"a": value}) == number


@pytest.mark.parametrize("text", ["sqrt(a)", "1/(a + 1)", "log(a)", "a^0.5", "exp(-1e4*a)"])
def test_what_has_no_real_value_is_told(text: str) -> None:
    expression = to_sympy(parsed(text), {"a": sp.Symbol("a", real=True)})
    with pytest.raises(InputError, match="no real value at a = -1"):
        evaluated(expression, {"a": -1.0})
