"""Expressions -> bodies of C functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy as sp

from rigsight.simulate.equations.straight_line import StraightLine, needed_steps
from rigsight.simulate.printing.language import C_LANES, C

_NO_STEPS: Mapping[sp.Symbol, sp.Expr] = {}

# Only functions that are called are written: some compilers warn of unused ones.
FUNCTIONS = {
    "sign_of": "static inline double sign_of(double value) { return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0); }",
    "positive": "static inline double positive(double value) { return value > 0.0 ? value : 0.0; }",
    "within": (
        "static inline double within(double value, double limit) "
        "{ return value > limit ? limit : (value < -limit ? -limit : value); }"
    ),
}


def real(name: str) -> sp.Symbol:
    """Return a symbol whose name is C code already."""
    return sp.Symbol(name, real=True)


def symbols(array: str, count: int) -> list[sp.Symbol]:
    """Return the elements of a C array as symbols."""
    return [real(element) for element in elements(array, count)]


def elements(array: str, count: int) -> list[str]:
    """Return the elements of a C array as text."""
    return [f"{array}[{i}]" for i in range(count)]


def function_body(
    arguments: Sequence[str],
    targets: Sequence[str],
    expressions: Sequence[sp.Expr],
    names: Mapping[sp.Symbol, str],
    *further: str,
    lanes: bool = False,
    steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS,
) -> str:
    """Return the body of a function; arguments that its equations do not use are marked as unused for the compiler."""
    needed = needed_steps(expressions, steps)
    read = set().union(*(e.free_symbols for e in (*expressions, *needed.values())))
    for symbol in sorted(read - set(needed) - set(names), key=str):
        raise KeyError(
            f"The symbol {symbol} has no number: names of rigs and effects must not appear in C code."
        )
    lines = (C_LANES if lanes else C).statements(targets, expressions, names, needed) if targets else []
    return _marked(arguments, lines, further)


def lane_body(targets: Sequence[str], line: StraightLine, names: Mapping[sp.Symbol, str]) -> str:
    """Return the body of a function of vector lanes that computes expressions in parts."""
    return _marked((), C_LANES.written(targets, line, names), ())


def _marked(arguments: Sequence[str], lines: Sequence[str], further: Sequence[str]) -> str:
    text = "\n".join([*lines, *further])
    unread = [a for a in arguments if f"{a}[" not in text and f"{a}->" not in text]
    marks = [" ".join(f"(void){argument};" for argument in unread)] if unread else []
    return "\n".join(f"    {line}" for line in [*marks, *lines, *further])
