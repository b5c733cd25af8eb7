"""Printing of expressions in MATLAB, in a form that Octave can run, too."""

from __future__ import annotations

import sympy as sp
from sympy.printing.octave import OctaveCodePrinter

from rigsight.simulate.printing.language import Language


class MatlabPrinter(OctaveCodePrinter):  # type: ignore[misc]
    """MATLAB for scalars, so that operators need no dot."""

    def _print_Mul(self, expr: sp.Mul) -> str:  # noqa: N802
        return str(super()._print_Mul(expr)).replace(".*", "*").replace("./", "/")

    def _print_Pow(self, expr: sp.Pow) -> str:  # noqa: N802
        return str(super()._print_Pow(expr)).replace(".^", "^").replace("./", "/")

    def _print_absolute(self, expr: sp.Function) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0)"


MATLAB = Language(MatlabPrinter(), "{} = {};", "{} = {};")
