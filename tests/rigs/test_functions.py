"""Everything that works with equations accepts every function that a rig file may call, at its kinks too."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
import sympy as sp

from rigsight.effects.symbols import derivative
from rigsight.errors import InputError
from rigsight.export.fixed_step import internal_step
from rigsight.identify.rig_equations import equations_of
from rigsight.identify.start.linearized_responses import LinearizedResponses
from rigsight.identify.start.weak_equations import WeakEquations
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.rigs.evaluation import array_function
from rigsight.rigs.reading.expressions import FUNCTIONS
from rigsight.rigs.reading.rig_file import rig_of_text
from rigsight.simulate import compose, simulate
from rigsight.simulate.equations.derivatives import slope_functions
from rigsight.simulate.equilibrium import can_drift
from rigsight.simulate.model import Model
from rigsight.workflow.run.variation_sweep import Pair, variation_sweep

from ..tiers import slow_but

RIG = """
name = "every_function"
[inputs.u]
unit = "N"
[constants.a]
unit = "m"
default = 0.01
[constants.b]
unit = "m/s"
default = 0.1
[parameters.m]
unit = "kg"
lower = 1e-3
[parameters.d]
unit = "N s/m"
[parameters.k]
unit = "N/m"
[parameters.c]
unit = "N"
[coordinates.x]
unit = "m"
[energy]
kinetic = "m*d(x)^2/2"
[joints.guide]
motion = "x"
stiffness = "k"
damping = "d"
force = "{force}"
[drives.motor]
signal = "u"
force = "motor"
along = "x"
[sensors.position]
reads = "x"
unit = "m"
"""
VALUES = {"a": 0.01, "b": 0.1, "m": 2.0, "d": 8.0, "k": 300.0, "c": 0.05}
FREE = ["m", "d", "k", "c"]
FURTHER = ("0.2", "0.5")


def called(name: str, argument: str) -> str:
    """The function with its first argument given, and positive where it has no real value otherwise."""
    first = f"abs({argument}) + 1" if name in ("sqrt", "log") else argument
    return f"{name}({', '.join([first, *FURTHER][: len(FUNCTIONS[name].arguments)])})"


def rig(force: str) -> Rig:
    return rig_of_text(RIG.format(force=force))


@pytest.mark.parametrize("argument", slow_but("d(x)/b", of=["x/a", "d(x)/b"]))
def test_a_force_made_of_every_function_can_be_identified_discovered_and_exported(argument: str) -> None:
    other = "d(x)/b" if argument == "x/a" else "x/a"
    own = rig(f"c*({' + '.join(called(name, argument) for name in FUNCTIONS)} + sin({other}))")
    t = 0.01 * np.arange(100)
    record = Record("run", 0.01, {"u": np.sin(9 * t), "position": 0.01 * np.sin(9 * t)}, {})
    equations, structure = equations_of(own), compose(own)
    truth = np.array([VALUES[name] for name in FREE])
    constants = {name: VALUES[name] for name in "ab"}
    weak = WeakEquations(equations, [record], constants, FREE)
    # 1e6 stands for an error that cannot be computed.
    assert np.max(np.abs(weak.errors(truth))) < 1e6
    linear = LinearizedResponses(equations, [record], constants, FREE, [np.zeros(2)])
    assert np.all(np.isfinite(linear.errors(truth)))
    p = np.array([VALUES[name] for name in structure.names])
    assert np.all(np.isfinite(slope_functions(structure).at(np.zeros(2), np.zeros(1), p)[0][0]))
    assert not can_drift(own, VALUES)
    assert 0.0 < internal_step(Model(structure, VALUES, "foh")) < 0.1


def test_dry_friction_written_in_a_rig_file_is_simulated_and_has_equations_for_a_start() -> None:
    own = rig("c*sign(d(x)/b) + 0*c*sin(x/a)")
    t = 0.01 * np.arange(300)
    record = simulate(compose(own), VALUES, Record("run", 0.01, {"u": 4.0 * np.sin(9 * t)}, {}))
    weak = WeakEquations(equations_of(own), [record], {name: VALUES[name] for name in "ab"}, FREE)
    truth = np.array([VALUES[name] for name in FREE])
    without = np.array([*truth[:-1], 0.0])
    assert np.mean(weak.errors(truth) ** 2) < 0.2 * np.mean(weak.errors(without) ** 2)


@pytest.mark.parametrize("limit", ["max(c/e, 0.2)", "min(c/e, 0.2)", "clip(c/e, 0.1, 0.5)", "abs(c/e)"])
def test_a_limit_on_a_parameter_alone_is_exported(limit: str) -> None:
    text = RIG.format(force=f"c*{limit}*tanh(x/a + d(x)/b)").replace(
        "[parameters.m]", '[constants.e]\nunit = "N"\n[parameters.m]'
    )
    structure = compose(rig_of_text(text))
    assert 0.0 < internal_step(Model(structure, {**VALUES, "e": 0.1}, "foh")) < 0.1


EACH_BEFORE_AND_BEHIND_ANOTHER = [
    (outer, inner)
    for outer, inner in zip(FUNCTIONS, [*list(FUNCTIONS)[1:], next(iter(FUNCTIONS))], strict=True)
]


@pytest.mark.parametrize(
    ("outer_name", "inner_name"),
    slow_but(*EACH_BEFORE_AND_BEHIND_ANOTHER, of=product(FUNCTIONS, repeat=2)),
)
def test_derivatives_of_functions_of_functions_can_be_evaluated(outer_name: str, inner_name: str) -> None:
    outer, inner = FUNCTIONS[outer_name], FUNCTIONS[inner_name]
    x, a, n = (sp.Symbol(name, real=True) for name in "xan")
    at, step = (0.713, 0.83, 1.37), 1e-6
    rest = (sp.Rational(1, 5), sp.Rational(1, 2))
    for argument in (x / a, x**n):
        value = inner.build(*(argument, *rest)[: len(inner.arguments)])
        value = outer.build(*(value, *rest)[: len(outer.arguments)])
        ahead, behind = (_number(value, (x, a, n), (at[0] + s, *at[1:])) for s in (step, -step))
        slope = _number(derivative(value, x), (x, a, n), at)
        if math.isfinite(ahead):
            assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-5, abs=1e-7), value


def _number(expression: sp.Expr, symbols: tuple[sp.Symbol, ...], at: tuple[float, ...]) -> float:
    with np.errstate(all="ignore"):
        return float(array_function(symbols, expression)(*map(np.float64, at)))


def test_a_band_is_asked_for_where_the_equations_have_no_value_at_rest() -> None:
    text = RIG.format(force="c*sin(x/a) + c*tanh(d(x)/b)")
    text = text.replace('force = "motor"', 'force = "motor + c*atan2(motor/c, motor/c)"')
    with pytest.raises(InputError, match="--lowest and --highest"):
        variation_sweep(Model(compose(rig_of_text(text)), VALUES, "foh"), Pair("u", "position"), 1.0, None)
