"""Header of an exported file: source, equations, signals with units, and how to supply inputs."""

from __future__ import annotations

from importlib.metadata import version

from rigsight.export.equations import Exported
from rigsight.simulate.input_hold import Hold
from rigsight.simulate.printing.names import rate_symbol
from rigsight.simulate.printing.notation import text, text_equation
from rigsight.simulate.printing.shown import shown_equations

HOLDS: dict[Hold, str] = {"zoh": "constant from each sample to the next", "foh": "linear between samples"}
MOTION_HOLD = "the cubic through values and rates at both ends of a sample time"


def hold_text(exported: Exported) -> str:
    """Return how the inputs behave between their samples, as a clause."""
    held = [source.value.name for source in exported.sources if source.rate is None]
    moved = [source.value.name for source in exported.sources if source.rate is not None]
    if not exported.sources:
        return "there is no input"
    if not moved:
        return f"the {'input is' if len(held) == 1 else 'inputs are'} {HOLDS[exported.hold]}"
    if not held:
        return f"the {'motion is' if len(moved) == 1 else 'motions are'} {MOTION_HOLD}"
    verb = "is" if len(held) == 1 else "are"
    return f"{', '.join(held)} {verb} {HOLDS[exported.hold]}, {', '.join(moved)} {MOTION_HOLD}"


def made_by(source: str) -> str:
    """Return by what and from what a file was made."""
    return f"Made by rigsight {version('rigsight')} from {source}"


def equation_lines(exported: Exported) -> list[str]:
    """Return the equations in plain text, one a line, in the names of the export."""
    structure, names = exported.structure, exported.names()
    if not structure.rig.has_one_motion:
        return [*_as_shown(exported), *_held_lines(exported)]
    lines = []
    if structure.delay is not None:
        name = exported.inputs[0].name
        lines.append(f"{name} arrives {text(structure.delay, names)} late")
    for state, equation in zip(exported.states, structure.equations, strict=True):
        line = f"{state.name}' = {text(equation.rate, names)}"
        if equation.limit is not None:
            line += f", abs({state.name}) <= {text(equation.limit, names)}: "
            line += "it stays at the end of its range while driven against it"
        lines.append(line)
    for i, (output, expression) in enumerate(zip(exported.outputs, structure.outputs, strict=True)):
        line = f"output {output.name} [{output.unit}] = {text(expression, names)}"
        if i == 0 and structure.first_shown_late is not None:
            line += f", read {text(structure.first_shown_late, names)} late"
        lines.append(line)
    return [*lines, *_held_lines(exported)]


def _as_shown(exported: Exported) -> list[str]:
    """Return the equations as displayed: solved for the accelerations they would be unreadable."""
    shown, own = shown_equations(exported.structure), exported.names()
    names = {symbol: name.plain.replace(" ", "_") for symbol, name in shown.names.items()}
    names |= {rate_symbol(state): f"{own[state]}'" for state in exported.structure.states}
    # The rate of a coordinate is a state itself, and has the name of one.
    names |= own
    return [text_equation(equation, names) for equation in shown.equations]


def _held_lines(exported: Exported) -> list[str]:
    names = exported.names()
    slips = (exported.frozen.switches[mode] for mode in exported.frictions)
    return [f"dry friction holds {text(slip, names)} at zero while it can" for slip in slips]


def header_lines(exported: Exported, source: str) -> list[str]:
    """Return what stands at the head of every exported file."""
    lines = [f"{made_by(source)}; SI units.", "", "Equations:"]
    inputs = [f"input {q.name} [{q.unit}]: {q.description}" for q in exported.inputs]
    states = [f"state {q.name} [{q.unit}]" for q in exported.states]
    return lines + [f"  {line}" for line in (*equation_lines(exported), *inputs, *states)]


def indented(lines: list[str], level: int = 1) -> str:
    """Return lines as one text, four blanks deeper for each level."""
    return "\n".join("    " * level + line if line else "" for line in lines)
