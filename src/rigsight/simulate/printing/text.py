"""Printing of expressions and equations as plain text, for comments and terminals."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from rigsight.simulate.printing.shown import ReadingOrder, ShownEquation

_JOINED = {"": "", "+": " + ", "-": " - "}
_WITHIN = " within |%s| <= %s"


class TextPrinter(StrPrinter):  # type: ignore[misc]
    """sympy's text with ``^`` for powers, ``max`` for positive parts and numbers of six digits."""

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: N802
        return str(super()._print_Pow(expr, rational=rational)).replace("**", "^")

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0)"

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return f"{float(expr):.6g}"


class EquationPrinter(ReadingOrder, TextPrinter):
    """Text in the form of equations: products without a sign, bars for absolute values."""

    def _print_Mul(self, expr: sp.Expr) -> str:  # noqa: N802
        return str(super()._print_Mul(expr)).replace("*", " ")

    def _print_Abs(self, expr: sp.Expr) -> str:  # noqa: N802
        return f"|{self._print(expr.args[0])}|"

    def _print_late(self, expression: sp.Expr) -> str:
        signal, delay = expression.args
        return f"{self._print(signal)}(t - {self.parenthesize(delay, PRECEDENCE['Mul'])})"

    def _print_moved(self, expression: sp.Expr) -> str:
        mass, rate = expression.args
        return f"{self.parenthesize(mass, PRECEDENCE['Mul'], strict=True)} {self._print(rate)}"


class TermPrinter(EquationPrinter):
    """A single term in a short form, without spaces in powers."""

    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        return super()._print_Pow(expr, rational=rational).replace(" ", "")


def text(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """Return an expression as plain text with its symbols renamed."""
    return str(
        TextPrinter().doprint(
            expression.xreplace({s: sp.Symbol(name, real=True) for s, name in names.items()})
        )
    )


def text_equation(equation: ShownEquation, names: Mapping[sp.Symbol, str]) -> str:
    """Return an equation as plain text with its symbols renamed."""
    symbols = {s: sp.Symbol(name, real=True) for s, name in names.items()}
    printer = EquationPrinter()

    def expression(shown: sp.Expr) -> str:
        return str(printer.doprint(shown.xreplace(symbols)))

    left, right = equation.written(expression, _JOINED, _WITHIN)
    return f"{left} = {right}".replace("=  - ", "= -")
