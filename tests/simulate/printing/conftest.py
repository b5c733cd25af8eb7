"""What the simulation computes of a structure at one instant: the only place that the test of shown equations asks.

The frozen equations as they are printed as code: exact at any instant. The compiled kernel, which tells no rates, is asked by
what it moves in a moment, in a test of its own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import pytest
import sympy as sp

from rigsight.simulate import Structure
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.printing.language import PYTHON


@dataclass(frozen=True)
class Instant:
    """Rates by state and outputs by column at one instant; the first output is read `reading_delay` later."""

    rates: dict[sp.Symbol, float]
    outputs: dict[str, float]
    reading_delay: float


@pytest.fixture(scope="session")
def simulated_instant() -> Callable[..., Instant]:
    return _simulated_instant


def _simulated_instant(
    structure: Structure,
    numbers: Mapping[sp.Symbol, float],
    source: Callable[[int, float, int], float],
    time: float,
) -> Instant:
    """Return what is simulated for numbers of states and parameters, and inputs as functions of index, time and derivative."""
    frozen = freeze(structure)
    known: dict[sp.Symbol, float] = dict(numbers)
    late = 0.0 if structure.delay is None else _values([structure.delay], known)[0]
    known[TIME] = time
    for index in range(len(structure.rig.inputs)):
        for derivative, symbol in enumerate(input_symbols(index)):
            known[symbol] = source(index, time - late, derivative)
    for mode, switch in zip(frozen.modes, frozen.switches, strict=True):
        known[mode] = 1.0 if _values([switch], known)[0] >= 0.0 else -1.0
    rates = _values(frozen.rates, known)
    outputs = _values(frozen.outputs[: len(structure.outputs)], known)
    reading_delay = (
        0.0 if structure.first_shown_late is None else _values([structure.first_shown_late], known)[0]
    )
    return Instant(
        dict(zip(structure.states, rates, strict=True)),
        dict(zip((s.name for s in structure.rig.outputs), outputs, strict=True)),
        reading_delay,
    )


def _values(expressions: Sequence[sp.Expr], known: Mapping[sp.Symbol, float]) -> list[float]:
    scope: dict[str, Any] = {
        "math": math,
        "sign_of": lambda value: math.copysign(1.0, value) if value else 0.0,
        **{f"number_{i}": value for i, value in enumerate(known.values())},
    }
    exec(_code(tuple(expressions), tuple(known)), scope)
    return [float(scope[f"value_{i}"]) for i in range(len(expressions))]


@cache
def _code(expressions: tuple[sp.Expr, ...], symbols: tuple[sp.Symbol, ...]) -> Any:
    names = {symbol: f"number_{i}" for i, symbol in enumerate(symbols)}
    targets = [f"value_{i}" for i in range(len(expressions))]
    return compile("\n".join(PYTHON.statements(targets, expressions, names)), "equations", "exec")
