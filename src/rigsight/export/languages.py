"""How is a symbolic expression written in each language of the exports?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.printing.c import C99CodePrinter
from sympy.printing.octave import OctaveCodePrinter

from rigsight.simulate.expressions import KernelPrinter


class MatlabPrinter(OctaveCodePrinter):  # type: ignore[misc]
    """MATLAB, of scalars, so that no operator needs its dot."""

    def _print_Mul(self, expr: sp.Mul) -> str:  # noqa: N802
        return str(super()._print_Mul(expr)).replace(".*", "*").replace("./", "/")

    def _print_Pow(self, expr: sp.Pow) -> str:  # noqa: N802
        return str(super()._print_Pow(expr)).replace(".^", "^").replace("./", "/")

    def _print_absolute(self, expr: sp.Function) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0)"


class ModelicaPrinter(C99CodePrinter):  # type: ignore[misc]
    """Modelica: ``^`` for powers; ``abs``, ``sign`` and ``max`` are its own and find their events by themselves."""

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


@dataclass(frozen=True)
class Language:
    """How statements look: the printer, a fresh variable and an assignment."""

    printer: Any
    declared: str
    assigned: str

    def expression(self, expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
        """Return one expression with its symbols renamed."""
        return str(self.printer.doprint(_plain(_renamed(expression, names))))

    def statements(
        self, targets: Sequence[str], expressions: Sequence[sp.Expr], names: Mapping[sp.Symbol, str]
    ) -> list[str]:
        """Return statements that assign expressions to targets, sharing common parts.

        Parameters
        ----------
        targets
            Left-hand sides.
        expressions
            Right-hand sides, same length.
        names
            Name in the code of each symbol.
        """
        renamed = [_renamed(expression, names) for expression in expressions]
        parts = (sp.Symbol(f"part{i}", real=True) for i in range(10_000))
        shared, reduced = sp.cse(renamed, symbols=parts, optimizations=None)
        lines = [self.declared.format(s.name, self.printer.doprint(_plain(e))) for s, e in shared]
        return lines + [
            self.assigned.format(target, self.printer.doprint(_plain(e)))
            for target, e in zip(targets, reduced, strict=True)
        ]


MATLAB = Language(MatlabPrinter(), "{} = {};", "{} = {};")
MODELICA = Language(ModelicaPrinter(), "{} = {};", "{} = {};")
PYTHON = Language(KernelPrinter(), "{} = {}", "{} = {}")


def _renamed(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> sp.Expr:
    return expression.xreplace({symbol: sp.Symbol(name, real=True) for symbol, name in names.items()})


def _plain(expression: sp.Expr) -> sp.Expr:
    return expression.evalf() if expression.is_number else expression
