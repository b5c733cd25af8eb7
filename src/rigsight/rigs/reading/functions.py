"""Which functions may expressions of a rig file call? Kinks are those that the simulation knows how to cross."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import sympy as sp

from rigsight.effects.symbols import positive_part


@dataclass(frozen=True)
class Function:
    """A function that expressions may call."""

    arguments: tuple[str, ...]  # how many it takes, for messages: their names
    build: Callable[..., sp.Expr]  # the expression it stands for
    # ``"pure"`` takes and gives plain numbers, ``"same"`` takes one unit and gives it, ``"sign"`` takes any
    # unit and gives a plain number, ``"root"`` gives the root of its unit.
    kind: str


def _larger(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    return b + positive_part(a - b)


def _smaller(a: sp.Expr, b: sp.Expr) -> sp.Expr:
    return a - positive_part(a - b)


FUNCTIONS: Mapping[str, Function] = {
    **{
        name: Function(("x",), getattr(sp, name), "pure")
        for name in ("sin", "cos", "tan", "atan", "exp", "log", "tanh")
    },
    "atan2": Function(("y", "x"), sp.atan2, "ratio"),
    "sqrt": Function(("x",), sp.sqrt, "root"),
    # sympy takes the magnitude of an exponential of a power for exp(re(...)), as if it could be complex.
    "abs": Function(("x",), lambda x: sp.Abs(x).replace(sp.re, lambda real: real), "same"),
    "sign": Function(("x",), sp.sign, "sign"),
    "max": Function(("x", "y"), _larger, "same"),
    "min": Function(("x", "y"), _smaller, "same"),
    "clip": Function(("x", "low", "high"), lambda x, low, high: _smaller(_larger(x, low), high), "same"),
}
