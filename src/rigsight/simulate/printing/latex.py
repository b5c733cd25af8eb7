"""Printing of equations as LaTeX."""

from __future__ import annotations

import re
from collections.abc import Mapping

import sympy as sp
from sympy.printing.latex import LatexPrinter as SympyLatexPrinter
from sympy.printing.precedence import PRECEDENCE

from rigsight.simulate.printing.names import GREEK, ShownName, named
from rigsight.simulate.printing.shown import ReadingOrder, ShownEquation

_DIGITS = 6
"""Significant digits of numbers in an effect's equation; values of parameters are given separately."""
_JOINED = {"": "", "+": " + ", "-": " - "}
_WITHIN = r",\quad \left|%s\right| \leq %s"
_ACCENTS = ("", r"\dot", r"\ddot")


def latex_equation(equation: ShownEquation, names: Mapping[sp.Symbol, ShownName]) -> tuple[str, str]:
    """Return both sides of an equation as LaTeX for math mode."""
    left, right = equation.written(LatexPrinter(names).expression, _JOINED, _WITHIN)
    return left, right.strip()


def latex_name(name: ShownName) -> str:
    r"""Return a name as LaTeX for math mode: ``k_{c}``, ``\dot{\psi}``."""
    letter = name.letter
    if letter in GREEK:
        letter = f"\\{letter}"
    elif len(letter) > 1:
        letter = rf"\mathrm{{{latex_text(letter)}}}"
    if name.dots:
        letter = f"{_ACCENTS[name.dots]}{{{letter}}}"
    return f"{letter}_{{{', '.join(map(_below, name.below))}}}" if name.below else letter


def latex_text(text: str, *, math: bool = False) -> str:
    """Return text with the special characters of LaTeX escaped; in math mode ``^`` remains a power."""
    special = r"([&%$#_{}])" if math else r"([&%$#_{}^])"
    return re.sub(special, r"\\\1", text.replace("\\", "/")).replace("\\^", r"\^{}")


class LatexPrinter(ReadingOrder, SympyLatexPrinter):  # type: ignore[misc]
    """sympy's LaTeX with the displayed names.

    Parameters
    ----------
    names
        Name of each symbol.
    """

    def __init__(self, names: Mapping[sp.Symbol, ShownName]) -> None:
        symbols = {sp.Symbol(name.plain, real=True): latex_name(name) for name in names.values()}
        super().__init__({"symbol_names": symbols, "full_prec": False})
        self._names = names

    def expression(self, expression: sp.Expr) -> str:
        """Return an expression of named symbols."""
        return str(self.doprint(named(expression, self._names)))

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return str(super()._print_Float(sp.Float(expr, _DIGITS)))

    def _print_late(self, expression: sp.Expr) -> str:
        signal, delay = map(self._print, expression.args)
        return rf"{signal}\left(t - {delay}\right)"

    def _print_moved(self, expression: sp.Expr) -> str:
        mass, rate = expression.args
        return f"{self.parenthesize(mass, PRECEDENCE['Mul'], strict=True)} {self._print(rate)}"


def _below(word: str) -> str:
    if word in GREEK:
        return f"\\{word}"
    return word if len(word) <= 2 else rf"\text{{{latex_text(word)}}}"
