"""How is a structure written as equations that people read? Plain text, and LaTeX."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp
from sympy.printing.latex import LatexPrinter
from sympy.printing.str import StrPrinter

from rigsight.simulate import Structure
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME

_DIGITS = 4
"""Of the numbers that an effect's equation holds; parameters stand as symbols and lose none."""


class _Text(StrPrinter):  # type: ignore[misc]
    def _print_Pow(self, expr: sp.Expr, rational: bool = False) -> str:  # noqa: N802
        return str(super()._print_Pow(expr, rational=rational)).replace("**", "^")

    def _print_Mul(self, expr: sp.Expr) -> str:  # noqa: N802
        return str(super()._print_Mul(expr)).replace("*", " ")

    def _print_Abs(self, expr: sp.Expr) -> str:  # noqa: N802
        return f"|{self._print(expr.args[0])}|"

    def _print_positive_part(self, expr: sp.Expr) -> str:
        return str(f"max(0, {self._print(expr.args[0])})")

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return f"{float(expr):.{_DIGITS}g}"


class _Tex(LatexPrinter):  # type: ignore[misc]
    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return str(super()._print_Float(sp.Float(expr, _DIGITS)))


def equations(structure: Structure, numbers: Mapping[str, float]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the equations of motion of a structure as text and as LaTeX, one per dynamic state.

    Parameters
    ----------
    structure
        Rig and effects; kinematic rows (x' = v) are left out.
    numbers
        Parameters that stand as numbers: those that no fit moved, a scale of one or a force of zero.
    """
    plain, pretty = _names(structure)
    written = {sp.Symbol(f"p_{name}", real=True): sp.nsimplify(value) for name, value in numbers.items()}
    rows = [(left, right.xreplace(written)) for left, right in _rows(structure)]
    printer = _Tex({"symbol_names": pretty})
    text = [f"{left[0]} = {_Text().doprint(right.xreplace(plain))}" for left, right in rows]
    latex = [f"{left[1]} = {printer.doprint(right)}" for left, right in rows]
    first = len(rows) - len(structure.equations)
    for index, equation in enumerate(structure.equations):
        if equation.limit is not None:
            state, limit = equation.symbol, equation.limit.xreplace(written)
            text[first + index] += f" within |{plain[state]}| <= {_Text().doprint(limit.xreplace(plain))}"
            latex[first + index] += rf",\quad |{pretty[state]}| \le {printer.doprint(limit)}"
    return tuple(text), tuple(latex)


def _rows(structure: Structure) -> list[tuple[tuple[str, str], sp.Expr]]:
    rig = structure.rig
    own = {f"p_{p.name}": sp.Symbol(f"p_{p.name}", real=True) for p in structure.parameters}
    if rig.motion.inertia is None:
        rows = [((rig.outputs[0].name, rig.outputs[0].name), structure.outputs[0])]
        first = 0
    else:
        name = rig.outputs[0].name
        inertia = own[f"p_{rig.motion.inertia.name}"]
        # The rate is a force divided by the inertia, and nothing else holds the inertia.
        right = structure.equations[1].rate * inertia
        left = (
            f"{rig.motion.inertia.name} {name}''",
            rf"{sp.latex(rig.motion.inertia)} \ddot{{{_tex(name)}}}",
        )
        rows = [(left, right)]
        first = 2
    for equation in structure.equations[first:]:
        short = _state_name(structure, equation.symbol)
        rows.append(((f"{short}'", rf"\dot{{{_tex(short)}}}"), equation.rate))
    return rows


def _state_name(structure: Structure, symbol: sp.Symbol) -> str:
    """Return the state's own name without its effect's, where that is enough to know it."""
    short = symbol.name.split(".")[-1]
    same = [s for s in structure.states if s.name.split(".")[-1] == short]
    return str(short if len(same) == 1 else symbol.name.replace(".", "_"))


def _names(structure: Structure) -> tuple[dict[sp.Symbol, sp.Symbol], dict[sp.Symbol, str]]:
    """Return what symbols are called in text and in LaTeX."""
    rig = structure.rig
    plain: dict[sp.Symbol, str] = {TIME: "t"}
    tex: dict[sp.Symbol, str] = {TIME: "t"}
    displacement = rig.outputs[0].name if rig.is_driven else rig.inputs[0].name
    source = rig.inputs[0].name
    if rig.is_driven:
        late = structure.delay is not None
        plain |= {rig.motion.displacement: displacement, rig.motion.velocity: f"{displacement}'"}
        tex |= {
            rig.motion.displacement: _tex(displacement),
            rig.motion.velocity: rf"\dot{{{_tex(displacement)}}}",
        }
        plain[INPUT] = f"{source}(t - T_d)" if late else source
        tex[INPUT] = rf"{source}(t - T_d)" if late else source
    else:
        plain |= {INPUT: displacement, INPUT_RATE: f"{displacement}'"}
        tex |= {INPUT: _tex(displacement), INPUT_RATE: rf"\dot{{{_tex(displacement)}}}"}
    for state in structure.states:
        if state not in plain:
            plain[state], tex[state] = _state_name(structure, state), _tex(_state_name(structure, state))
    for parameter in structure.parameters:
        symbol = sp.Symbol(f"p_{parameter.name}", real=True)
        plain[symbol], tex[symbol] = parameter.name, _tex(parameter.name.split(".")[-1])
    return {symbol: sp.Symbol(name, real=True) for symbol, name in plain.items()}, tex


def _tex(name: str) -> str:
    return str(sp.latex(sp.Symbol(name)))
