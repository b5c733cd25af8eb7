"""Printing of equations as MathML, which browsers display and read aloud."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter
from sympy.printing.precedence import PRECEDENCE

from rigsight.simulate.printing.names import ShownName, named
from rigsight.simulate.printing.shown import ReadingOrder, ShownEquation

_TIMES = '<mo lspace="0.14em" rspace="0.14em">&InvisibleTimes;</mo>'
"""A little space, so that names of several letters do not run into each other."""
_DOTS = ("", "\u02d9", "\u00a8")
_JOINED = {"": "", "+": "<mo>+</mo>", "-": "<mo>&minus;</mo>"}
_WITHIN = "<mo>,</mo><mspace width='1em'/><mo>|</mo>%s<mo>|</mo><mo>&le;</mo>%s"


def mathml_equation(equation: ShownEquation, names: Mapping[sp.Symbol, ShownName]) -> str:
    """Return an equation as a block of MathML; every name passes through a printer that escapes it."""
    left, right = equation.written(MathMLPrinter(names).expression, _JOINED, _WITHIN)
    return f'<math display="block"><mrow>{left}<mo>=</mo>{right}</mrow></math>'


class MathMLPrinter(ReadingOrder, MathMLPresentationPrinter):  # type: ignore[misc]
    """sympy's MathML with the displayed names.

    Parameters
    ----------
    names
        Name of each symbol.
    """

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
