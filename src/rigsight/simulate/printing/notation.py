"""Printing of equations for readers: as plain text, LaTeX and MathML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.printing.latex import LatexPrinter as SympyLatexPrinter
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from rigsight.simulate.printing.names import GREEK, ShownName, named
from rigsight.simulate.printing.shown import ReadingOrder, ShownEquation

_JOINED = {"": "", "+": " + ", "-": " - "}
_TEXT_WITHIN = " within |%s| <= %s"

_DIGITS = 6
"""Significant digits of numbers in an effect's equation; values of parameters are given separately."""
_LATEX_WITHIN = r",\quad \left|%s\right| \leq %s"
_ACCENTS = ("", r"\dot", r"\ddot")

_TIMES = '<mo lspace="0.14em" rspace="0.14em">&InvisibleTimes;</mo>'
"""A little space, so that names of several letters do not run into each other."""
_DOTS = ("", "\u02d9", "\u00a8")
_MATHML_JOINED = {"": "", "+": "<mo>+</mo>", "-": "<mo>&minus;</mo>"}
_MATHML_WITHIN = "<mo>,</mo><mspace width='1em'/><mo>|</mo>%s<mo>|</mo><mo>&le;</mo>%s"


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


def text(expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    """Return an expression as plain text with its symbols renamed."""
    symbols = {s: sp.Symbol(name, real=True) for s, name in names.items()}
    return str(TextPrinter().doprint(expression.xreplace(symbols)))


def text_equation(equation: ShownEquation, names: Mapping[sp.Symbol, str]) -> str:
    """Return an equation as plain text with its symbols renamed."""
    symbols = {s: sp.Symbol(name, real=True) for s, name in names.items()}
    printer = EquationPrinter()

    def expression(shown: sp.Expr) -> str:
        return str(printer.doprint(shown.xreplace(symbols)))

    left, right = equation.written(expression, _JOINED, _TEXT_WITHIN)
    return f"{left} = {right}".replace("=  - ", "= -")


def latex_equation(equation: ShownEquation, names: Mapping[sp.Symbol, ShownName]) -> tuple[str, str]:
    """Return both sides of an equation as LaTeX for math mode."""
    left, right = equation.written(LatexPrinter(names).expression, _JOINED, _LATEX_WITHIN)
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
    return f"{letter}_{{{', '.join(map(_latex_below, name.below))}}}" if name.below else letter


def latex_text(text: str, *, math: bool = False) -> str:
    """Return text with the special characters of LaTeX escaped; in math mode ``^`` remains a power."""
    special = r"([&%$#_{}])" if math else r"([&%$#_{}^])"
    return re.sub(special, r"\\\1", text.replace("\\", "/")).replace("\\^", r"\^{}")


class LatexPrinter(ReadingOrder, SympyLatexPrinter):  # type: ignore[misc]
    """sympy's LaTeX with the displayed names."""

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


def _latex_below(word: str) -> str:
    if word in GREEK:
        return f"\\{word}"
    return word if len(word) <= 2 else rf"\text{{{latex_text(word)}}}"


def mathml_equation(equation: ShownEquation, names: Mapping[sp.Symbol, ShownName]) -> str:
    """Return an equation as a block of MathML; every name passes through a printer that escapes it."""
    left, right = equation.written(MathMLPrinter(names).expression, _MATHML_JOINED, _MATHML_WITHIN)
    return f'<math display="block"><mrow>{left}<mo>=</mo>{right}</mrow></math>'


class MathMLPrinter(ReadingOrder, MathMLPresentationPrinter):  # type: ignore[misc]
    """sympy's MathML with the displayed names."""

    def __init__(self, names: Mapping[sp.Symbol, ShownName]) -> None:
        super().__init__()
        self._names = names
        self._by_plain = {name.plain: name for name in names.values()}

    def expression(self, expression: sp.Expr) -> str:
        """Return an expression of named symbols."""
        text = str(self.doprint(named(expression, self._names)))
        return text.replace("<mo>-</mo>", "<mo>&minus;</mo>").replace("<mo>&InvisibleTimes;</mo>", _TIMES)

    def _print_Symbol(self, sym: sp.Symbol, style: str = "plain") -> Any:  # noqa: N802
        name = self._by_plain.get(sym.name)
        if name is None:
            return super()._print_Symbol(sym, style)
        shown = super()._print_Symbol(sp.Symbol(name.letter), style)
        if name.dots:
            shown = self._element("mover", shown, self._text("mo", _DOTS[name.dots]))
        if name.below:
            shown = self._element("msub", shown, self._below(name.below, style))
        return shown

    def _below(self, words: tuple[str, ...], style: str) -> Any:
        if len(words) == 1 and " " not in words[0]:
            return super()._print_Symbol(sp.Symbol(words[0]), style)
        return self._text("mtext", ", ".join(words).replace(" ", "\u00a0").replace(",\u00a0", ", "))

    def _print_late(self, expression: sp.Expr) -> Any:
        signal, delay = map(self._print, expression.args)
        open_, close = self._text("mo", "("), self._text("mo", ")")
        return self._element(
            "mrow", signal, open_, self._text("mi", "t"), self._text("mo", "-"), delay, close
        )

    def _print_moved(self, expression: sp.Expr) -> Any:
        mass, rate = expression.args
        times = self._text("mo", "&InvisibleTimes;")
        return self._element(
            "mrow", self.parenthesize(mass, PRECEDENCE["Mul"], strict=True), times, self._print(rate)
        )

    def _print_Float(self, e: sp.Float) -> Any:  # noqa: N802
        return self._text("mn", f"{float(e):.4g}")

    def _print_positive_part(self, expression: sp.Expr) -> Any:
        return self._print(sp.Function("max")(sp.Integer(0), expression.args[0]))

    def _element(self, tag: str, *children: Any) -> Any:
        element = self.dom.createElement(tag)
        for child in children:
            element.appendChild(child)
        return element

    def _text(self, tag: str, text: str) -> Any:
        return self._element(tag, self.dom.createTextNode(text))
