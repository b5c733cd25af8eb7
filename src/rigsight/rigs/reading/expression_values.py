"""Conversion of a parsed expression to symbols, with checks that its value is real and finite."""

from __future__ import annotations

import math
from collections.abc import Mapping

import sympy as sp
from lark import Token, Tree

from rigsight.errors import nearest
from rigsight.rigs.reading.expressions import MOST_POWER, READS, Expression, ExpressionError, place_of
from rigsight.rigs.reading.functions import FUNCTIONS

_LARGEST = 1e300
"""Largest constant; products of a few of them leave the range of numbers."""


def to_sympy(expression: Expression, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    """Return an expression as sympy sees it."""
    built = _built(expression.tree, symbols)
    if built.has(sp.I, sp.nan, sp.zoo, sp.oo):
        raise ExpressionError("this has no real value")
    return built


def _built(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    value = _of_node(node, symbols)
    if value.is_number and not value.is_Rational:
        _check_number(value, place_of(node))
    elif value.is_Rational and abs(value) > _LARGEST:
        raise ExpressionError("a number is too large", place_of(node))
    return value


def _check_number(value: sp.Expr, place: int) -> None:
    try:
        number = complex(value)
    except (OverflowError, TypeError, ValueError):
        raise ExpressionError("a number is too large or undefined", place) from None
    if number.imag != 0.0 or math.isnan(number.real):
        raise ExpressionError("this has no real value", place)
    if abs(number.real) > _LARGEST:
        raise ExpressionError("a number is too large", place)


def _of_node(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    assert isinstance(node, Tree)
    if node.data == "number":
        return _number(str(node.children[0]), place_of(node))
    if node.data in READS:
        written = READS[str(node.data)](str(node.children[0]))
        if written not in symbols:
            raise ExpressionError(
                f"'{written}' is not known here.{nearest(written, symbols)}", place_of(node)
            )
        return symbols[written]
    if node.data == "call":
        name, *arguments = node.children
        return FUNCTIONS[str(name)].build(*(_built(argument, symbols) for argument in arguments))
    parts = [_built(child, symbols) for child in node.children]
    match node.data:
        case "sum":
            return sp.Add(*parts)
        case "product":
            return sp.Mul(*parts)
        case "negative" | "minus":
            return -parts[0]
        case "plus" | "times":
            return parts[0]
        case "over":
            if parts[0].is_zero:
                raise ExpressionError("a division by zero", place_of(node.children[0]))
            return 1 / parts[0]
    base, exponent = parts
    if exponent.is_number and abs(float(exponent)) > MOST_POWER:
        raise ExpressionError(
            f"an exponent must be within +-{MOST_POWER}, this one is {float(exponent):g}",
            place_of(node.children[1]),
        )
    power = base**exponent
    if power.is_Pow and power.exp.is_number and abs(float(power.exp)) > MOST_POWER:
        raise ExpressionError(
            f"powers of powers must stay within +-{MOST_POWER}, this is the {float(power.exp):g}th",
            place_of(node),
        )
    return power


def _number(text: str, place: int) -> sp.Expr:
    """Return a number: whole ones stay whole, as powers of symbols need them."""
    value = float(text)
    if math.isinf(value):
        raise ExpressionError(f"{text} is too large", place)
    if text.isdigit() and len(text) <= 15:
        return sp.Integer(int(text))
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 1e15 else sp.Float(value)
