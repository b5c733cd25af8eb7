"""What does an exported file say of itself: source, equations, numbers with units, and how to feed it?"""

from __future__ import annotations

from importlib.metadata import version
from typing import Any

import sympy as sp
from sympy.printing.str import StrPrinter

from rigsight.export.equations import Exported
from rigsight.simulate.input_hold import Hold

HOLDS: dict[Hold, str] = {
    "zoh": "the input is constant from each sample to the next",
    "foh": "the input is linear between samples",
}
MOTION_HOLD = "the motion is the cubic through values and rates at both ends of a sample time"


class _TextPrinter(StrPrinter):  # type: ignore[misc]
    def _print_positive_part(self, expr: sp.Function) -> str:
        return f"max({self._print(expr.args[0])}, 0)"

    def _print_Float(self, expr: sp.Float) -> str:  # noqa: N802
        return f"{float(expr):.6g}"


def hold_text(exported: Exported) -> str:
    """Return how the input behaves between its samples, as a clause."""
    return MOTION_HOLD if exported.rest is None else HOLDS[exported.hold]


def made_by(source: str) -> str:
    """Return by what and from what a file was made."""
    return f"Made by rigsight {version('rigsight')} from {source}"


def equation_lines(exported: Exported) -> list[str]:
    """Return the equations in plain text, one a line, in the names of the export."""
    names: dict[sp.Symbol, str] = exported.names()

    def text(expression: sp.Expr) -> str:
        renamed = expression.xreplace({s: sp.Symbol(name, real=True) for s, name in names.items()})
        return str(_TextPrinter().doprint(renamed)).replace("**", "^")

    structure = exported.structure
    lines = []
    if structure.delay is not None:
        name = exported.inputs[0].name
        lines.append(f"{name} arrives {text(structure.delay)} late")
    for state, equation in zip(exported.states, structure.equations, strict=True):
        line = f"{state.name}' = {text(equation.rate)}"
        if equation.limit is not None:
            line += f", abs({state.name}) <= {text(equation.limit)}: it rests at the end it is driven against"
        lines.append(line)
    for i, (output, expression) in enumerate(zip(exported.outputs, structure.outputs, strict=True)):
        line = f"output {output.name} [{output.unit}] = {text(expression)}"
        if i == 0 and structure.measured_late is not None:
            line += f", read {text(structure.measured_late)} late"
        lines.append(line)
    if exported.frozen.friction_mode is not None:
        lines.append(f"dry friction holds {exported.states[_velocity(exported)].name} at zero while it can")
    return lines


def signal_lines(exported: Exported) -> list[str]:
    """Return inputs and states with units, one a line."""
    lines = [f"input {q.name} [{q.unit}]: {q.description}" for q in exported.inputs]
    return lines + [f"state {q.name} [{q.unit}]" for q in exported.states]


def parameter_lines(exported: Exported) -> list[str]:
    """Return the parameters with numbers, units and descriptions, one a line."""
    pairs = zip(exported.parameters, exported.values, strict=True)
    return [f"{q.name} = {value!r} [{q.unit}]: {q.description}" for q, value in pairs]


def header_lines(exported: Exported, source: str, *, with_parameters: bool = True) -> list[str]:
    """Return what stands at the head of every exported file.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    with_parameters
        False where the parameters stand below with their units.
    """
    lines = [f"{made_by(source)}; SI units.", "", "Equations:"]
    lines += [f"  {line}" for line in (*equation_lines(exported), *signal_lines(exported))]
    if with_parameters:
        lines += ["", "Parameters:", *(f"  {line}" for line in parameter_lines(exported))]
    return lines


def filled(template: str, fragments: dict[str, Any]) -> str:
    """Return a template with its marks ``<<NAME>>`` replaced."""
    for key, text in fragments.items():
        template = template.replace(f"<<{key}>>", str(text))
    return template


def indented(lines: list[str], level: int = 1) -> str:
    """Return lines as one text, four blanks deeper for each level."""
    return "\n".join("    " * level + line if line else "" for line in lines)


def _velocity(exported: Exported) -> int:
    index = exported.structure.velocity_index
    assert index is not None
    return index
