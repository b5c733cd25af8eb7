"""How does a model become Modelica text?"""

from __future__ import annotations

import re

from rigsight.export.description import header_lines
from rigsight.export.equations import Exported, Quantity, words
from rigsight.export.fixed_step import state_at_rest
from rigsight.simulate.equations.straight_line import StraightLine, straight_line
from rigsight.simulate.equations.structure import INPUT
from rigsight.simulate.printing.language import MODELICA, part_name

WORDS = words(
    """algorithm and annotation block break class connect connector constant constrainedby der discrete each else elseif
    elsewhen encapsulated end enumeration equation expandable extends external false final flow for function if import in
    initial inner input loop model not operator or outer output package parameter partial protected public pure record
    redeclare replaceable return stream then time true type when while within"""
)
"""Of the language."""
FUNCTIONS = words("Real acos asin atan atan2 cos cosh entry exp log log10 sin sinh sqrt tan tanh")
"""Names that are built in and that the text uses, beside those that no name in any export is; sympy's printer alters `entry`."""


def modelica(exported: Exported, source: str, name: str) -> str:
    """Return the text of one model without a library."""
    structure, names = exported.structure, exported.names()
    used = {q.name for q in (*exported.parameters, *exported.states, *exported.inputs)}
    declared = [f"parameter Real {q.name}{_unit(q)} = {value!r} {_said(q)};" for q, value in exported.numbers]
    declared += [f"input Real {q.name}{_unit(q)} {_said(q)};" for q in exported.inputs]
    equations: list[str] = []
    if structure.delay is not None:
        late = _free(f"{exported.inputs[0].name}_late", used)
        declared.append(f'Real {late} "input as it arrives";')
        equations.append(
            f"{late} = delay({exported.inputs[0].name}, {MODELICA.expression(structure.delay, names)});"
        )
        names = {**names, INPUT: late}
    own_outputs, shown = _outputs(exported, used)
    if structure.elimination is not None:
        accelerations = structure.elimination.accelerations
        line = straight_line(accelerations, structure.steps)
        declared += [f"Real {part_name(part)};" for part in line.parts]
        equations += MODELICA.written([], StraightLine(line.parts, ()), names)
        names = {**names, **{a: part_name(a) for a in accelerations}}
    for state, equation, start in zip(
        exported.states, structure.equations, state_at_rest(exported), strict=True
    ):
        kind = "output Real" if state.name in own_outputs else "Real"
        declared.append(f"{kind} {state.name}{_unit(state, f'start={start!r}, fixed=true')} {_said(state)};")
        rate = MODELICA.expression(equation.rate, names)
        if equation.limit is not None:
            half = MODELICA.expression(equation.limit, names)
            driven = f"({state.name} >= {half} and {rate} > 0) or ({state.name} <= -({half}) and {rate} < 0)"
            rate = f"if {driven} then 0 else {rate}"
        equations.append(f"der({state.name}) = {rate};")
    for i, (own, quantity) in shown.items():
        declared.append(f"output Real {own}{_unit(quantity)} {_said(quantity)};")
        value = MODELICA.expression(structure.outputs[i], names)
        if i == 0 and structure.first_shown_late is not None:
            value = f"delay({value}, {MODELICA.expression(structure.first_shown_late, names)})"
        equations.append(f"{own} = {value};")
    head = header_lines(exported, source)
    lines = [
        f'model {name} "{_quoted(exported.title)}"',
        *(f"  // {line}".rstrip() for line in head),
        *(f"  {line}" for line in declared),
        "equation",
        *(f"  {line}" for line in equations),
        f"end {name};",
    ]
    return "\n".join(lines) + "\n"


def _outputs(exported: Exported, used: set[str]) -> tuple[set[str], dict[int, tuple[str, Quantity]]]:
    """Return the states that are outputs as they are, and by index the other outputs with a name of their own."""
    structure = exported.structure
    own: set[str] = set()
    shown: dict[int, tuple[str, Quantity]] = {}
    for i, (output, expression) in enumerate(zip(exported.outputs, structure.outputs, strict=True)):
        late = i == 0 and structure.first_shown_late is not None
        state = exported.names().get(expression)
        if state == output.name and not late:
            own.add(output.name)
        else:
            wished = output.name if output.name not in used else f"{output.name}_measured"
            shown[i] = (_free(wished, used), output)
    return own, shown


def _free(wished: str, used: set[str]) -> str:
    while wished in used:
        wished += "_"
    used.add(wished)
    return wished


def _unit(quantity: Quantity, more: str = "") -> str:
    """Return the modification with the unit in Modelica's notation: ``N.m/rad3`` for ``N m/rad^3``."""
    unit = re.sub(r"\^", "", quantity.unit.replace(" ", "."))
    # A unit of the user's own may be no word of Modelica's grammar of units; then it stays in the comment.
    known = re.fullmatch(r"[A-Za-z0-9./()-]+", unit) is not None
    parts = [f'unit="{unit}"'] if known and unit else []
    parts += [more] if more else []
    return f"({', '.join(parts)})" if parts else ""


def _said(quantity: Quantity) -> str:
    return f'"{_quoted(f"{quantity.description} [{quantity.unit}]")}"'


def _quoted(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
