"""How is an expression written as plain text, for comments and terminals?"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp
from sympy.printing.str import StrPrinter


class TextPrinter(StrPrinter):  # type: ignore[misc]
    """sympy's text with ``^`` for powers, ``max`` for positive parts and numbers of six digits."""

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: N802
        return str(super()._print_Pow(expr, rational=rational)).replace("**", "^")

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0)"

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return f"{float(expr):.6g}"


class TermPrinter(StrPrinter):  # type: ignore[misc]
    """A single term as short as it can be read: bars for absolute values, no spaces in powers."""

    def _print_Abs(self, expr: sp.Expr) -> str:  # noqa: N802
        return f"|{self._print(expr.args[0])}|"

    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        return str(super()._print_Pow(expr, rational=rational)).replace("**", "^").replace(" ", "")


def text(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """Return an expression as plain text with its symbols renamed."""
    return str(
        TextPrinter().doprint(
            expression.xreplace({s: sp.Symbol(name, real=True) for s, name in names.items()})
        )
    )
