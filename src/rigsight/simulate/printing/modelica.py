"""Printing of expressions in Modelica."""

from __future__ import annotations

import sympy as sp
from sympy.printing.c import C99CodePrinter

from rigsight.simulate.printing.language import Language


class ModelicaPrinter(C99CodePrinter):  # type: ignore[misc]
    """Modelica: ``^`` for powers; ``abs``, ``sign`` and ``max`` are built in and generate their own events."""

    def _print_Pow(self, expr: sp.Pow) -> str:  # noqa: N802
        if expr.exp == -1:
            return f"1.0/{self.parenthesize(expr.base, 1000)}"
        if expr.exp == sp.Rational(1, 2):
            return f"sqrt({self._print(expr.base)})"
        return f"{self.parenthesize(expr.base, 1000)}^{self.parenthesize(expr.exp, 1000)}"

    def _print_Abs(self, expr: sp.Abs) -> str:  # noqa: N802
        return f"abs({self._print(expr.args[0])})"

    def _print_sign(self, expr: sp.sign) -> str:
        return f"sign({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0.0)"


MODELICA = Language(ModelicaPrinter(), "{} = {};", "{} = {};")
