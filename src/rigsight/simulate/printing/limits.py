"""Sums of positive parts that represent `min`, `max` and `clip`, which are displayed instead."""

from __future__ import annotations

import sympy as sp

from rigsight.effects.symbols import positive_part

_MIN, _MAX, _CLIP = map(sp.Function, ("min", "max", "clip"))
"""The displayed functions: `min` and `max` of two values, `clip` of a value and the ends of its range."""


def with_limits(expression: sp.Expr) -> sp.Expr:
    """Return an expression with its limits as named functions."""
    if not expression.has(positive_part):
        return expression
    if expression.is_Add:
        for found in (_clamped(expression), _smaller(expression), _larger(expression)):
            if found is not None:
                return found
    return expression.func(*map(with_limits, expression.args))


def _clamped(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``x - positive_part(x - high) + positive_part(low - x)``."""
    for down in _parts(total, -1):
        for up in _parts(total, 1):
            x = total + down - up
            high, low = x - down.args[0], x + up.args[0]
            # If the lower end is above the upper one, the sum differs from a clip.
            ordered = low == -high or (high - low).is_nonnegative
            if ordered and _bounds(high, x) and _bounds(low, x):
                return _CLIP(with_limits(x), low, high)
    return None


def _smaller(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``a - positive_part(a - high)``."""
    for part in _parts(total, -1):
        a = total + part
        high = a - part.args[0]
        if _bounds(high, a):
            inner = with_limits(a)
            if isinstance(inner, _MAX) and not inner.args[1].has(positive_part):
                return _CLIP(*inner.args, high)
            return _MIN(inner, with_limits(high))
    return None


def _larger(total: sp.Expr) -> sp.Expr | None:
    """Recognize ``low + positive_part(a - low)``."""
    for part in _parts(total, 1):
        low = total - part
        a = low + part.args[0]
        if _bounds(low, a):
            return _MAX(with_limits(a), with_limits(low))
    return None


def _parts(total: sp.Expr, sign: int) -> list[sp.Expr]:
    return [sign * term for term in total.args if isinstance(sign * term, positive_part)]


def _bounds(bound: sp.Expr, x: sp.Expr) -> bool:
    """Return True if an expression can be an end of the range of x: it has no symbol in common with x."""
    return x != 0 and not bound.has(positive_part) and not bound.free_symbols & x.free_symbols
