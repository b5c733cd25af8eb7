"""Printing of expressions in Python, with floats and the module `math`."""

from __future__ import annotations

import sympy as sp
from sympy.printing.pycode import PythonCodePrinter

from rigsight.simulate.printing.language import Language, PowersAsProducts


class PythonPrinter(PowersAsProducts, PythonCodePrinter):  # type: ignore[misc]
    """Python; ``sign_of`` is a function in the generated file."""

    def __init__(self) -> None:
        super().__init__({"fully_qualified_modules": True, "strict": False})

    def _print_Abs(self, expr: sp.Abs) -> str:  # noqa: N802
        return f"abs({self._print(expr.args[0])})"

    def _print_absolute(self, expr: sp.Function) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0.0)"

    def _print_sign(self, expr: sp.sign) -> str:
        return f"sign_of({self._print(expr.args[0])})"

    def _print_Rational(self, expr: sp.Rational) -> str:  # noqa: N802
        return repr(float(expr))

    def _print_Half(self, expr: sp.Expr) -> str:  # noqa: ARG002, N802
        return "0.5"


PYTHON = Language(PythonPrinter(), "{} = {}", "{} = {}")
