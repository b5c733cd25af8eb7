"""Statements of a programming language, independent of the language."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import sympy as sp
from sympy.printing.c import C99CodePrinter
from sympy.printing.octave import OctaveCodePrinter
from sympy.printing.pycode import PythonCodePrinter

from rigsight.simulate.equations.straight_line import StraightLine, needed_steps, straight_line

_NO_STEPS: Mapping[sp.Symbol, sp.Expr] = {}


class PowersAsProducts:
    """Small powers as products, because `pow` is slow and, in a control loop, has no guaranteed duration."""

    def _print_Pow(self, expr: sp.Pow, rational: bool = False) -> str:  # noqa: ARG002, N802
        printer: Any = self
        if expr.exp.is_Integer and 2 <= abs(int(expr.exp)) <= 6:
            product = "*".join([printer.parenthesize(expr.base, 1000)] * abs(int(expr.exp)))
            return f"({product})" if expr.exp > 0 else f"(1.0/({product}))"
        return str(super()._print_Pow(expr))  # type: ignore[misc]


@dataclass(frozen=True)
class Language:
    """Syntax of a language: its printer, and the forms of a declaration and of an assignment."""

    printer: Any
    declared: str
    assigned: str

    def expression(self, expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
        """Return one expression with its symbols renamed."""
        named = {symbol: names[symbol] for symbol in expression.free_symbols if symbol in names}
        return str(self.printer.doprint(_plain(expression.xreplace(_symbols(named)))))

    def statements(
        self,
        targets: Sequence[str],
        expressions: Sequence[sp.Expr],
        names: Mapping[sp.Symbol, str],
        steps: Mapping[sp.Symbol, sp.Expr] = _NO_STEPS,
    ) -> list[str]:
        """Return statements that assign expressions to targets, sharing common parts."""
        if needed_steps(expressions, steps):
            return self.written(targets, straight_line(expressions, steps), names)
        known = _symbols(names)
        renamed = [expression.xreplace(known) for expression in expressions]
        parts = (sp.Symbol(f"part{i}", real=True) for i in range(10_000))
        shared, reduced = sp.cse(renamed, symbols=parts, optimizations=None)
        lines = [self.declared.format(s.name, self.printer.doprint(_plain(e))) for s, e in shared]
        return lines + [
            self.assigned.format(target, self.printer.doprint(_plain(e)))
            for target, e in zip(targets, reduced, strict=True)
        ]

    def written(
        self, targets: Sequence[str], line: StraightLine, names: Mapping[sp.Symbol, str]
    ) -> list[str]:
        """Return statements that assign expressions, whose parts are known, to targets."""
        own = {part: part_name(part) for part in line.parts}
        every = {**names, **own}
        known = _symbols(every)
        printed = [_printed(self.printer, e.xreplace(known)) for e in (*line.parts.values(), *line.results)]
        forms = [(self.declared, name) for name in own.values()]
        forms += [(self.assigned, target) for target in targets]
        return [form.format(target, text) for (form, target), text in zip(forms, printed, strict=True)]


def part_name(part: sp.Symbol) -> str:
    """Return the name in code of a part of an expression; in exports it differs from all names of rigs and effects."""
    return f"part_{part.name.replace(' ', '_')}"


@lru_cache(maxsize=16_384)
def _printed(printer: Any, expression: sp.Expr) -> str:
    """Return a part as code, cached because those of a rig do not depend on its effects."""
    return str(printer.doprint(_plain(expression)))


def _symbols(names: Mapping[sp.Symbol, str]) -> dict[sp.Symbol, sp.Symbol]:
    return {symbol: sp.Symbol(name, real=True) for symbol, name in names.items()}


def _plain(expression: sp.Expr) -> sp.Expr:
    return expression.evalf() if expression.is_number else expression


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
