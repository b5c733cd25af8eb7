"""Derivatives of expressions whose parts occur again and again, as those of an arm."""

from __future__ import annotations

from time import process_time

import pytest
import sympy as sp

from rigsight.effects.symbols import derivative, positive_part

X, A = sp.symbols("x a", real=True)


def carried(n_links: int) -> sp.Expr:
    """Return an expression in which each step reads the one before twice."""
    expression: sp.Expr = X
    for _ in range(n_links):
        expression = sp.sin(expression) * (A + expression)
    return expression


def test_each_part_is_differentiated_once() -> None:
    begin = process_time()
    slope = derivative(carried(17), X)
    # One for each occurrence takes half a minute.
    assert process_time() - begin < 5.0
    assert slope.has(A)


@pytest.mark.parametrize(
    "expression",
    [
        carried(5),
        A**X * X**A,
        sp.sqrt(X**2 + A**2) / (1 + sp.tanh(X) ** 3),
        sp.Piecewise((X**2, X < A), (sp.exp(X), True)),
        sp.atan2(X, A) + sp.Max(X, A * X),
        sp.Integer(3) + A,
    ],
)
def test_a_derivative_is_that_of_sympy(expression: sp.Expr) -> None:
    assert derivative(expression, X) - sp.Derivative(expression, X).doit() == 0


@pytest.mark.parametrize("x", [-0.7, 0.4])
def test_signs_have_no_slope(x: float) -> None:
    expression = sp.Abs(X**3) * sp.sign(X / A) + positive_part(X) ** 2
    slope = derivative(expression, X).subs({X: x, A: 2.0}).doit()
    assert float(slope.replace(positive_part, lambda e: sp.Max(0, e))) == pytest.approx(
        3 * x**2 + 2 * max(x, 0.0)
    )
