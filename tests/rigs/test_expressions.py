"""Expressions mean what they say, and what has no meaning is told with its place."""

from __future__ import annotations

import pytest
import sympy as sp

from rigsight.rigs.reading.expressions import ExpressionError, parsed, to_sympy

NAMES = {name: sp.Symbol(name, real=True) for name in ("a", "b", "c", "d", "d(phi)")}
VALUES = dict(zip(NAMES.values(), (0.7, -1.3, 2.1, 0.4, -0.9), strict=True))


def value(text: str) -> float:
    from rigsight.effects.symbols import positive_part

    expression = to_sympy(parsed(text), NAMES).subs(VALUES)
    return float(expression.replace(positive_part, lambda x: sp.Max(x, 0)))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a + b*-c^2", 0.7 - 1.3 * -(2.1**2)),
        ("-a^2", -0.49),
        ("2^3^2", 512.0),
        ("a - b - c", 0.7 + 1.3 - 2.1),
        ("a / b / c", 0.7 / -1.3 / 2.1),
        ("d*d(phi)", 0.4 * -0.9),
        ("1.5e-3*a", 1.05e-3),
        ("max(a, b) + min(a, b)", 0.7 - 1.3),
        ("clip(b, -1, 1)", -1.0),
        ("clip(a, -1, 1)", 0.7),
        ("abs(b)*sign(b)", -1.3),
        ("atan2(b, -a)", -2.0647),
    ],
)
def test_an_expression_means_what_it_says(text: str, expected: float) -> None:
    assert value(text) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "place", "reported"),
    [
        ("sin(a", 4, "ends too early"),
        ("2 a", 2, "a product needs"),
        ("a**2", 1, "powers are written with"),
        ("siin(a)", 0, "Did you mean 'sin'"),
        ("min(a)", 0, r"min\(x, y\)"),
        ("a$b", 1, "is not allowed here"),
        ("d(a + b)", 0, "rate of one coordinate"),
        ("a^99", 2, "exponent"),
        ("1e999", 0, "too large"),
        ("a/0", 2, "division by zero"),
        ("a + e", 4, "'e' is not known"),
        ("", 0, "missing"),
        ("a" * 6000, 0, "5000 characters"),
    ],
)
def test_what_has_no_meaning_is_told_with_its_place(text: str, place: int, reported: str) -> None:
    with pytest.raises(ExpressionError, match=reported) as caught:
        to_sympy(parsed(text), NAMES)
    assert caught.value.place == place
