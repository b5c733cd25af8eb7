"""Equations of a structure as plain text and LaTeX."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import sympy as sp

from rigsight.identify import FitResult
from rigsight.simulate import Structure
from rigsight.simulate.printing.notation import latex_equation, text_equation
from rigsight.simulate.printing.shown import ShownEquation, flat_equations

_DIGITS = 4
"""Significant digits of numbers in an effect's equation; parameters are written as symbols."""


def held_numbers(fit: FitResult) -> dict[str, float]:
    """Return the held parameters whose values are written into the equations: only 0 and 1, which make them shorter."""
    constants = {p.name for p in fit.structure.rig.constants}
    return {
        name: value
        for name, value in fit.values.items()
        if name not in fit.free and name not in constants and value in (0.0, 1.0)
    }


def equations(structure: Structure, numbers: Mapping[str, float]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the equations of a structure as text and as LaTeX: of motion, of states, of outputs other than single states."""
    symbols = dict(zip(structure.names, structure.parameter_symbols, strict=True))
    written = {
        symbols[name]: sp.Integer(value) if float(value).is_integer() else sp.Float(value)
        for name, value in numbers.items()
    }
    shown = flat_equations(structure, written)
    rounded = [_rounded(equation) for equation in shown.equations]
    # The text uses the same parameter names as the tables of their values.
    plain = {symbol: name.plain.replace(" ", "_") for symbol, name in shown.names.items()}
    plain |= {symbol: name for name, symbol in symbols.items()}
    text = tuple(text_equation(equation, plain) for equation in rounded)
    return text, tuple(" = ".join(latex_equation(equation, shown.names)) for equation in rounded)


def _rounded(equation: ShownEquation) -> ShownEquation:
    def short(expression: sp.Expr) -> sp.Expr:
        return expression.xreplace(
            {number: sp.Float(f"{float(number):.{_DIGITS}g}") for number in expression.atoms(sp.Float)}
        )

    limit = None if equation.limit is None else (equation.limit[0], short(equation.limit[1]))
    inertia = tuple((short(mass), acceleration) for mass, acceleration in equation.inertia)
    terms = tuple(map(short, equation.terms))
    return replace(equation, left=short(equation.left), terms=terms, limit=limit, inertia=inertia)
