"""Expressions in parts, and their derivatives, against the expressions themselves."""

from __future__ import annotations

import numpy as np
import sympy as sp

from rigsight.effects.symbols import positive_part
from rigsight.simulate.equations.derivatives import slopes_of
from rigsight.simulate.equations.straight_line import needed_steps, straight_line

X, Y, P = sp.symbols("x y p", real=True)
WHOLE = [
    sp.sin(X + Y) * (P * sp.cos(X + Y) + Y**2) + sp.Abs(X - P) ** 3,
    (P * sp.cos(X + Y) + Y**2) ** 2 / (1 + X**2),
    P**2 * X,
    sp.exp(-positive_part(Y - P)) * sp.tanh(X * Y),
]
MODULES = [{"positive_part": lambda x: np.maximum(x, 0.0)}, "numpy"]
PLACES = np.random.default_rng(1).normal(size=(3, 9))


def numbers(expression: sp.Expr) -> np.ndarray:
    return np.broadcast_to(sp.lambdify([X, Y, P], expression, MODULES)(*PLACES), PLACES.shape[1:])


def test_parts_give_the_whole() -> None:
    line = straight_line(WHOLE)
    assert line.parts
    assert sum(sp.count_ops(e) for e in (*line.parts.values(), *line.results)) < sum(map(sp.count_ops, WHOLE))
    for found, expression in zip(line.function([X, Y, P], MODULES)(*PLACES), WHOLE, strict=True):
        np.testing.assert_allclose(found, numbers(expression), rtol=1e-13)


def test_slopes_are_those_of_the_whole() -> None:
    found = slopes_of(straight_line(WHOLE), [X, Y, P]).function([X, Y, P], MODULES)(*PLACES)
    expected = [sp.diff(expression, s) for expression in WHOLE for s in (X, Y, P)]
    for own, slope in zip(found, expected, strict=True):
        own = np.broadcast_to(own, PLACES.shape[1:])
        np.testing.assert_allclose(own, numbers(slope), rtol=1e-12, atol=1e-14)


def test_steps_come_first_and_those_that_nothing_reads_not_at_all() -> None:
    a, b, c = sp.symbols("a b c", real=True)
    steps = {a: X + Y, b: sp.sin(a) * P, c: X**7}
    assert list(needed_steps([b**2], steps)) == [a, b]
    line = straight_line([b**2 + a], steps)
    known: set[sp.Symbol] = {X, Y, P}
    for symbol, part in line.parts.items():
        assert part.free_symbols <= known
        known.add(symbol)
    assert c not in known
    value = line.function([X, Y, P], MODULES)(1.0, 2.0, 0.5)[0]
    assert value == (0.5 * np.sin(3.0)) ** 2 + 3.0
