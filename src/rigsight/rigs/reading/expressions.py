"""Syntax and meaning of expressions of a rig file. Text is parsed, never executed.

Numbers, names, ``+ - * / ^``, parentheses, ``d(coordinate)`` for a rate, and a few functions. Kinks are written through the
functions that the simulation knows how to cross (`rigsight.rigs.reading.functions`).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import sympy as sp
from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedEOF, UnexpectedInput, UnexpectedToken

from rigsight.effects.symbols import positive_part
from rigsight.errors import nearest


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


_GRAMMAR = r"""
?sum: product | product (plus | minus)+
plus: "+" product
minus: "-" product
?product: signed | signed (times | over)+
times: "*" signed
over: "/" signed
?signed: "-" signed -> negative | "+" signed | power
?power: atom | atom "^" signed -> power
?atom: NUMBER -> number | NAME -> name | NAME "(" [sum ("," sum)*] ")" -> call | "(" sum ")"
NUMBER: /(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?/
NAME: /[A-Za-z_][A-Za-z_0-9]*/
%ignore /[ \t\r\n]+/
"""
_LONGEST = 5000
_DEEPEST = 60
MOST_POWER = 20
"""Largest exponent: no law of mechanics has a larger one, and what is made of one would leave the range of numbers."""
_DEEPEST_TREE = 120
"""Powers of powers and signs of signs: deeper ones are no formula, and what walks through them would not return."""
_LARGEST = 1e300
"""Largest constant; products of a few of them leave the range of numbers."""
RATE = "d"
"""``d(NAME)`` is the time derivative of a coordinate; a name without parentheses may be a parameter called d."""
FORCE = "force"
"""``force(JOINT)`` is all that a joint resists with; sensors of rigs with a prescribed motion read it."""
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z_0-9]*")


class ExpressionError(ValueError):
    """What is wrong with an expression, and at which of its characters, counted from 0."""

    def __init__(self, message: str, place: int = 0) -> None:
        super().__init__(message)
        self.place = place


@dataclass(frozen=True)
class Expression:
    """A parsed expression."""

    text: str  # as it was written
    tree: Tree[Token]  # its syntax

    @property
    def reads(self) -> dict[str, int]:
        """What it reads, ``phi``, ``d(phi)`` or ``force(shaft)``, with the place where each first stands, from 0."""
        found: dict[str, int] = {}
        for node in self.tree.iter_subtrees_topdown():  # type: ignore[no-untyped-call]
            if node.data in READS:
                found.setdefault(READS[str(node.data)](str(node.children[0])), place_of(node))
        return found


def parsed(text: str) -> Expression:
    """Return the syntax of an expression."""
    if len(text) > _LONGEST:
        raise ExpressionError(f"an expression may have {_LONGEST} characters, this one has {len(text)}")
    depth = deepest = 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        deepest = max(deepest, depth)
    if deepest > _DEEPEST:
        raise ExpressionError(f"parentheses may be nested {_DEEPEST} deep, these are {deepest} deep")
    if not text.strip():
        raise ExpressionError("an expression is missing")
    try:
        tree = _parser().parse(text)
    except UnexpectedInput as error:
        raise _reported(error, text) from None
    if not isinstance(tree, Tree):
        raise ExpressionError("this is not an expression")
    if _depth(tree) > _DEEPEST_TREE:
        raise ExpressionError(f"powers and signs may be nested {_DEEPEST_TREE} deep")
    return Expression(text, _checked(tree))


def _depth(tree: Tree[Token]) -> int:
    depth, nodes = 0, [tree]
    while nodes:
        depth, nodes = depth + 1, [c for node in nodes for c in node.children if isinstance(c, Tree)]
    return depth


def rate_name(name: str) -> str:
    """Return how the rate of a coordinate is written."""
    return f"{RATE}({name})"


def force_name(name: str) -> str:
    """Return how the force of a joint is written."""
    return f"{FORCE}({name})"


READS: Mapping[str, Callable[[str], str]] = {"name": str, "rate": rate_name, "force": force_name}
"""How each kind of part that reads a value is written."""


def is_identifier(name: str) -> bool:
    """Return True for a name that expressions can read."""
    return _IDENTIFIER.fullmatch(name) is not None


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR, start="sum", parser="lalr", maybe_placeholders=False)


def _reported(error: UnexpectedInput, text: str) -> ExpressionError:
    token = error.token if isinstance(error, UnexpectedToken) else None
    if isinstance(error, UnexpectedEOF) or (token is not None and token.type == "$END"):
        return ExpressionError("the expression ends too early", max(len(text.rstrip()) - 1, 0))
    place = error.pos_in_stream or 0
    found = text[place : place + 1]
    if isinstance(error, UnexpectedCharacters):
        prime = "; a rate is written d(phi)" if found == "'" else ""
        return ExpressionError(
            f"{found} is not allowed here{prime}; allowed are numbers, names, + - * / ^ and parentheses",
            place,
        )
    if text[max(place - 1, 0) : place + 1] == "**":
        return ExpressionError("powers are written with ^", place - 1)
    before = text[:place].rstrip()[-1:]
    is_product = found and (found.isalnum() or found in "(_") and (before.isalnum() or before in ")_")
    remedy = " (a product needs *)" if is_product else ""
    return ExpressionError(f"'{found if token is None else token}' is not expected here{remedy}", place)


def _checked(tree: Tree[Token]) -> Tree[Token]:
    """Return the tree with rates told from calls; calls of what is not known are refused."""
    for node in list(tree.iter_subtrees()):
        if node.data == "power":
            exponent = node.children[1]
            power = constant(exponent)
            if power is not None and abs(power) > MOST_POWER:
                why = f"an exponent must be within +-{MOST_POWER}, this one is {power:g}"
                raise ExpressionError(why, place_of(exponent))
        if node.data != "call":
            continue
        name, *arguments = node.children
        place = name.start_pos or 0  # type: ignore[union-attr]
        if name in (RATE, FORCE):
            if len(arguments) != 1 or not isinstance(arguments[0], Tree) or arguments[0].data != "name":
                of_rate, of_force = "the rate of one coordinate: d(phi)", "that of one joint: force(bearing)"
                meant = of_rate if name == RATE else of_force
                raise ExpressionError(f"{name}(...) is {meant}", place)
            node.data = "rate" if name == RATE else "force"
            node.children = list(arguments[0].children)
            continue
        function = FUNCTIONS.get(str(name))
        if function is None:
            listed = ", ".join(FUNCTIONS)
            raise ExpressionError(
                f"there is no function '{name}'.{nearest(str(name), FUNCTIONS)} Allowed: {listed}", place
            )
        if len(arguments) != len(function.arguments):
            raise ExpressionError(
                f"{name} takes {len(function.arguments)} arguments, {name}({', '.join(function.arguments)}), and "
                f"{len(arguments)} are given",
                place,
            )
    return tree


def constant(node: Any) -> float | None:
    """Return the value of a number as it is written, with its sign, or of a fraction of two; None for anything else."""
    if node.data == "number":
        return float(node.children[0])
    if node.data == "negative":
        inner = constant(node.children[0])
        return None if inner is None else -inner
    if node.data == "product" and [part.data for part in node.children[1:]] == ["over"]:
        above, below = constant(node.children[0]), constant(node.children[1].children[0])
        return None if above is None or not below else above / below
    return None


def place_of(node: Tree[Token] | Token) -> int:
    """Return the character at which a part of an expression begins, counted from 0."""
    if isinstance(node, Token):
        return node.start_pos or 0
    places = [place_of(child) for child in node.children]
    return min(places, default=0)


def to_sympy(expression: Expression, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    """Return an expression as sympy sees it."""
    built = _built(expression.tree, symbols)
    if built.has(sp.I, sp.nan, sp.zoo, sp.oo):
        raise ExpressionError("this has no real value")
    return built


def _built(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    value, place = _of_node(node, symbols), place_of(node)
    size = value if value.is_Rational else sp.S.Zero
    if value.is_number and not value.is_Rational:
        try:
            number = complex(value)
        except (OverflowError, TypeError, ValueError):
            raise ExpressionError("a number is too large or undefined", place) from None
        if number.imag != 0.0 or math.isnan(number.real):
            raise ExpressionError("this has no real value", place)
        size = number.real
    if abs(size) > _LARGEST:
        raise ExpressionError("a number is too large", place)
    return value


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
    if node.data == "over" and parts[0].is_zero:
        raise ExpressionError("a division by zero", place_of(node.children[0]))
    if node.data in _OPERATIONS:
        return _OPERATIONS[str(node.data)](*parts)
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


_OPERATIONS: Mapping[str, Callable[..., sp.Expr]] = {
    "sum": sp.Add,
    "product": sp.Mul,
    "negative": operator.neg,
    "minus": operator.neg,
    "plus": operator.pos,
    "times": operator.pos,
    "over": lambda below: 1 / below,
}


def _number(text: str, place: int) -> sp.Expr:
    """Return a number: whole ones stay whole, as powers of symbols need them."""
    value = float(text)
    if math.isinf(value):
        raise ExpressionError(f"{text} is too large", place)
    if text.isdigit() and len(text) <= 15:
        return sp.Integer(int(text))
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 1e15 else sp.Float(value)
