"""How do a model's equations and numbers become a fragment of LaTeX?"""

from __future__ import annotations

import re

from rigsight.export.description import made_by
from rigsight.export.equations import Exported
from rigsight.simulate.printing.notation import LatexPrinter, latex_equation, latex_name, latex_text
from rigsight.simulate.printing.shown import shown_equations

_THIN = r"\,"


def latex(exported: Exported, source: str) -> str:
    r"""Return equations as an ``align*`` (package amsmath), and a table of symbols, values and units."""
    shown = shown_equations(exported.structure)
    numbers = zip(exported.structure.parameter_symbols, exported.parameters, exported.values, strict=True)
    table = [
        rf"  ${latex_name(shown.names[symbol])}$ & ${_number(value)}$ & ${_unit(q.unit)}$ & {latex_text(q.description)} \\"
        for symbol, q, value in numbers
    ]
    printer, equations = LatexPrinter(shown.names), []
    for equation in shown.equations:
        equations.append(" &= ".join(latex_equation(equation, shown.names)))
    for mode in exported.frictions:
        slip = printer.expression(exported.frozen.switches[mode])
        equations.append(rf"{slip} &= 0 \text{{ while dry friction holds}}")
    lines = [
        f"% {exported.title}. {made_by(source)}.",
        "% For a document that loads amsmath. A state with a range, |z| <= g, rests at the end that it is driven against.",
        r"\begin{align*}",
        " \\\\\n".join(f"  {equation}" for equation in equations),
        r"\end{align*}",
        r"\begin{tabular}{llll}",
        r"  symbol & value & unit & meaning \\ \hline",
        *table,
        r"\end{tabular}",
    ]
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    mantissa, _, exponent = f"{value:.6g}".partition("e")
    return mantissa if not exponent else rf"{mantissa} \cdot 10^{{{int(exponent)}}}"


def _unit(unit: str) -> str:
    powers = re.sub(r"\^(-?[0-9]+)", r"^{\1}", latex_text(unit, math=True))
    return rf"\mathrm{{{powers.replace(' ', _THIN)}}}"
