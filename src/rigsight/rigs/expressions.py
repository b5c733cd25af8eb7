"""What may stand in an expression of a rig file, and what does it mean? Text is parsed, never executed.

Numbers, names, ``+ - * / ^``, parentheses, ``d(coordinate)`` for a rate, and a few functions. Kinks are written through the
functions that the simulation knows how to cross (`rigsight.effects.symbols`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import sympy as sp
from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedCharacters, UnexpectedEOF, UnexpectedInput, UnexpectedToken

from rigsight.effects.symbols import positive_part
from rigsight.errors import nearest

_GRAMMAR = r"""
?sum: product | sum "+" product -> add | sum "-" product -> subtract
?product: signed | product "*" signed -> multiply | product "/" signed -> divide
?signed: "-" signed -> negative | "+" signed | power
?power: atom | atom "^" signed -> power
?atom: NUMBER -> number | NAME -> name | NAME "(" [sum ("," sum)*] ")" -> call | "(" sum ")"
NUMBER: /(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?/
NAME: /[A-Za-z_][A-Za-z_0-9]*/
%ignore /[ \t\r\n]+/
"""
_LONGEST = 5000
_DEEPEST = 60
_MOST_POWER = 20
"""Largest constant exponent: no law of mechanics has a larger one, and an expansion of one would not end."""
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
class Function:
    """A function that expressions may call.

    Attributes
    ----------
    arguments
        How many it takes, for messages: their names.
    build
        The expression it stands for.
    kind
        ``"pure"`` takes and gives plain numbers, ``"same"`` takes one unit and gives it, ``"sign"`` takes any unit and gives a
        plain number, ``"root"`` gives the root of its unit.
    """

    arguments: tuple[str, ...]
    build: Callable[..., sp.Expr]
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
    "abs": Function(("x",), sp.Abs, "same"),
    "sign": Function(("x",), sp.sign, "sign"),
    "max": Function(("x", "y"), _larger, "same"),
    "min": Function(("x", "y"), _smaller, "same"),
    "clip": Function(("x", "low", "high"), lambda x, low, high: _smaller(_larger(x, low), high), "same"),
}


@dataclass(frozen=True)
class Expression:
    """A parsed expression.

    Attributes
    ----------
    text
        As it was written.
    tree
        Its syntax.
    """

    text: str
    tree: Tree[Token]

    @property
    def reads(self) -> dict[str, int]:
        """What it reads, ``phi``, ``d(phi)`` or ``force(shaft)``, with the place where each first stands, from 0."""
        found: dict[str, int] = {}
        for node in self.tree.iter_subtrees_topdown():  # type: ignore[no-untyped-call]
            if node.data in READS:
                found.setdefault(READS[str(node.data)](str(node.children[0])), place_of(node))
        return found


def parsed(text: str) -> Expression:
    """Return the syntax of an expression.

    Raises
    ------
    ExpressionError
        If the text is none, or calls something that is not known.
    """
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
        raise _told(error, text) from None
    if not isinstance(tree, Tree):
        raise ExpressionError("this is no expression")
    return Expression(text, _checked(tree))


def to_sympy(expression: Expression, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    """Return an expression as sympy sees it.

    Parameters
    ----------
    expression
        Parsed.
    symbols
        What each name, and each rate as ``"d(name)"``, stands for.

    Raises
    ------
    ExpressionError
        If a name stands for nothing, or a number leaves the range of numbers.
    """
    return _built(expression.tree, symbols)


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


def _told(error: UnexpectedInput, text: str) -> ExpressionError:
    place = len(text.rstrip())
    if (isinstance(error, UnexpectedToken) and error.token.type == "$END") or isinstance(
        error, UnexpectedEOF
    ):
        return ExpressionError("the expression ends too early", max(place - 1, 0))
    place = error.pos_in_stream or 0
    found = text[place : place + 1]
    if isinstance(error, UnexpectedCharacters):
        return ExpressionError(
            f"'{found}' has no meaning here; allowed are numbers, names, + - * / ^ and parentheses", place
        )
    if text[max(place - 1, 0) : place + 1] == "**":
        return ExpressionError("powers are written with ^", place - 1)
    before = text[:place].rstrip()[-1:]
    mend = (
        " (a product needs *)"
        if found and (found.isalnum() or found in "(_") and (before.isalnum() or before in ")_")
        else ""
    )
    return ExpressionError(
        f"'{error.token if isinstance(error, UnexpectedToken) else found}' is not expected here{mend}", place
    )


def _checked(tree: Tree[Token]) -> Tree[Token]:
    """Return the tree with rates told from calls; calls of what is not known are refused."""
    for node in list(tree.iter_subtrees()):
        if node.data != "call":
            continue
        name, *arguments = node.children
        place = name.start_pos or 0  # type: ignore[union-attr]
        if name in (RATE, FORCE):
            if len(arguments) != 1 or not isinstance(arguments[0], Tree) or arguments[0].data != "name":
                meant = (
                    "the rate of one coordinate: d(phi)"
                    if name == RATE
                    else "that of one joint: force(bearing)"
                )
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
                f"it is {name}({', '.join(function.arguments)}), with {len(arguments)} given", place
            )
    return tree


def place_of(node: Tree[Token] | Token) -> int:
    """Return the character at which a part of an expression begins, counted from 0."""
    if isinstance(node, Token):
        return node.start_pos or 0
    places = [place_of(child) for child in node.children]
    return min(places, default=0)


def _built(node: Tree[Token] | Token, symbols: Mapping[str, sp.Expr]) -> sp.Expr:
    assert isinstance(node, Tree)
    if node.data == "number":
        return number(str(node.children[0]), place_of(node))
    if node.data in READS:
        token = node.children[0]
        written = READS[str(node.data)](str(token))
        if written not in symbols:
            raise ExpressionError(
                f"'{written}' is not known here.{nearest(written, symbols)}", place_of(node)
            )
        return symbols[written]
    if node.data == "call":
        name, *arguments = node.children
        return FUNCTIONS[str(name)].build(*(_built(argument, symbols) for argument in arguments))
    parts = [_built(child, symbols) for child in node.children]
    if node.data == "negative":
        return -parts[0]
    first, second = parts
    if node.data == "add":
        return first + second
    if node.data == "subtract":
        return first - second
    if node.data == "multiply":
        return first * second
    if node.data == "divide":
        if second.is_zero:
            raise ExpressionError("a division by zero", place_of(node.children[1]))
        return first / second
    if second.is_number and abs(float(second)) > _MOST_POWER:
        raise ExpressionError(
            f"an exponent lies within +-{_MOST_POWER}, this one is {float(second):g}",
            place_of(node.children[1]),
        )
    return first**second


def number(text: str, place: int = 0) -> sp.Expr:
    """Return a number: whole ones stay whole, as powers of symbols need them.

    Raises
    ------
    ExpressionError
        If it is too large.
    """
    value = float(text)
    if math.isinf(value):
        raise ExpressionError(f"{text} is too large", place)
    if text.isdigit() and len(text) <= 15:
        return sp.Integer(int(text))
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 1e15 else sp.Float(value)
