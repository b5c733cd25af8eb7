"""How is a symbolic expression written in C?"""

from __future__ import annotations

import sympy as sp
from sympy.printing.c import C99CodePrinter

from rigsight.simulate.printing.language import Language, PowersAsProducts


class CPrinter(PowersAsProducts, C99CodePrinter):  # type: ignore[misc]
    """C99; ``sign_of`` is a function of the file."""

    def _print_sign(self, expr: sp.sign) -> str:
        return f"sign_of({self._print(expr.args[0])})"

    def _print_absolute(self, expr: sp.Function) -> str:
        return f"fabs({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"fmax({self._print(expr.args[0])}, 0.0)"


C = Language(CPrinter(), "const double {} = {};", "{} = {};")
