"""Equations with their kinks as modes: the same numbers as the equations themselves, wherever one kink contains others."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy as sp

from rigsight import rigs
from rigsight.effects import CATALOGUE, Effect, Place, effect_named, placed
from rigsight.effects.symbols import positive_part
from rigsight.rigs import read_rig_file
from rigsight.simulate import compose
from rigsight.simulate.equations.kinks import FrozenStructure, absolute, freeze

DRIVE_TRAIN = read_rig_file(Path(rigs.__file__).parent / "files" / "drive_train.toml")
BY_LOAD = placed(effect_named("load_dependent_friction"), "shaft")
AT_SHAFT = [placed(effect, "shaft") for effect in CATALOGUE if effect.place is Place.DYNAMICS]


def evaluated(expression: sp.Expr, at: dict[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return the number at a point, with functions that sympy evaluates."""
    known = expression.replace(absolute, sp.Abs).replace(positive_part, lambda part: sp.Max(part, 0))
    return known.xreplace(at).evalf()


def with_signs(frozen: FrozenStructure, at: dict[sp.Symbol, sp.Expr]) -> dict[sp.Symbol, sp.Expr]:
    """Return the point with the value of each mode; a switch contains only modes of earlier ones."""
    for mode, switch in zip(frozen.modes, frozen.switches, strict=True):
        at = {**at, mode: sp.sign(evaluated(switch, at))}
    return at


@pytest.mark.parametrize(
    "effect", [e for e in AT_SHAFT if e != BY_LOAD and DRIVE_TRAIN.offers(e)], ids=lambda effect: effect.name
)
@pytest.mark.parametrize("way", [1, -1])
def test_a_load_with_kinks_of_another_effect_stays_the_same_number(effect: Effect, way: int) -> None:
    structure = compose(DRIVE_TRAIN, [BY_LOAD, effect])
    frozen = freeze(structure)
    rates = [equation.limited_rate for equation in structure.remembering_equations]
    symbols = sorted(set().union(*(rate.free_symbols for rate in rates)), key=str)
    at = {symbol: sp.Float(0.3 + 0.17 * index) for index, symbol in enumerate(symbols)}
    at |= {state: at[state] * way**index for index, state in enumerate(structure.states) if state in at}
    signs = with_signs(frozen, at)
    kinks = set().union(*(rate.atoms(sp.Abs, sp.sign, positive_part) for rate in frozen.rates))
    assert all(kink.free_symbols <= set(structure.parameter_symbols) for kink in kinks)
    for rate, of_modes in zip(rates, frozen.rates, strict=True):
        assert float(evaluated(of_modes, signs)) == pytest.approx(float(evaluated(rate, at)))
