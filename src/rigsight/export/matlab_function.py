"""How does a model become one MATLAB function file, that Octave runs too?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import sympy as sp

from rigsight.export.description import header_lines
from rigsight.export.equations import NO_START, Balance, Exported, words
from rigsight.export.fixed_step import (
    constant_names,
    equations_of,
    fragments_of,
    held_velocity,
    slip_rate,
    slope_symbol,
)
from rigsight.libraries.templates import filled, template, template_parts
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.equilibrium import BALANCED
from rigsight.simulate.printing.language import MATLAB

WORDS = words(
    """break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd
    switch try while"""
)
"""Of the language."""
INPUT_WORDS = words(
    """advance c cubics_of diff dt error fieldnames floor given i initial_state input_pieces isempty lines_of motion_from n
    nargin numel p parameters pieces read_outputs read_signs reshape rest steps_of t zeros"""
)
"""Of the template where inputs are arguments and not read yet, beside what no name in any export is."""

_PIECE = "c({i}, :, :) = reshape({call}.', 1, 4, []);"
_CALLS = {"zoh": "steps_of({})", "foh": "lines_of({}, dt)", "cubic": "cubics_of({}, {}, dt)"}
_STOP_ONE = "m.x(<<VELOCITY>>) = 0;"
_OF_FRICTION = (
    "FRICTION_SIGN", "KEEP_HELD", "HOLD_AT_REST", "HELD_SLOPE", "HELD_DISTANCES", "FRICTION_CROSSED", "FRICTION",
)  # fmt: skip
"""Parts of the text about the sticking of dry friction."""


def matlab_function(exported: Exported, source: str, name: str) -> str:
    """Return the text of a function file."""
    structure, frozen, equations = exported.structure, exported.frozen, equations_of(exported)
    constants = {symbol: f"p.{name}" for symbol, name in constant_names(equations).items()}
    names = _names(exported) | constants
    prepare = MATLAB.statements(list(constants.values()), list(equations.constants.values()), names)
    modes = {mode: f"s({i + 1})" for i, mode in enumerate(frozen.modes)}
    inputs = [quantity.name for quantity in exported.inputs]
    head = header_lines(exported, source)
    late = structure.first_shown_late
    fragments = {
        "HEADER": "\n".join(f"% {line}".rstrip() for line in head),
        "ARGUMENTS": ", ".join(["t", *inputs]),
        "N_ARGUMENTS": 1 + len(inputs),
        "OUTPUT_TEXT": ", ".join(output.name for output in exported.outputs),
        "STATE_TEXT": ", ".join(state.name for state in exported.states) or "(none)",
        "DELAY": "0" if structure.delay is None else MATLAB.expression(structure.delay, names),
        "READ_SIGNS": "  m = read_signs(m, piece, start + split, 0);\n" if exported.hold == "zoh" else "",
        "AS_MEASURED": "" if late is None else _part("AS_MEASURED", {"LATE": MATLAB.expression(late, names)}),
        "PARAMETERS": "\n".join(
            f"p.{q.name} = {value!r};   % [{q.unit}] {q.description}" for q, value in exported.numbers
        ),
        "PREPARE": "\n".join(prepare),
        "RATES": _body("r", equations.rates, {**names, **modes}, equations.steps),
        "SWITCHES": _body("g", equations.switches, {**names, **modes}),
        "OUTPUTS": _body(
            "y", equations.outputs, {**names, frozen.friction_sign(0): "friction_sign"}, equations.shown_steps
        ),
        "PIECES": _pieces(exported, inputs),
        "WITHOUT_MODES": "" if frozen.modes else "  m.x = x_new;\n  return\n",
        **_friction(exported),
        "LIMITS": _limits(exported),
        "REST": _rest(exported),
        "N_OUTPUTS": len(exported.outputs),
        "N_COMPUTED": len(structure.computed_outputs),
        "NAME": name,
        **fragments_of(exported),
    }
    return filled(template("export", "model.m.txt"), fragments)


def _part(key: str, fragments: Mapping[str, object] = MappingProxyType({})) -> str:
    return filled(template_parts("export", "model_parts.m.txt")[key], fragments)


def _names(exported: Exported) -> dict[sp.Symbol, str]:
    structure = exported.structure
    names = {TIME: "time"}
    for index in range(len(exported.sources)):
        arrays = ("input_value", "input_rate", "input_curvature")
        names |= {s: f"{a}({index + 1})" for s, a in zip(input_symbols(index), arrays, strict=True)}
    return {
        **names,
        **{s: f"p.{q.name}" for s, q in zip(structure.parameter_symbols, exported.parameters, strict=True)},
        **{symbol: f"x({i + 1})" for i, symbol in enumerate(structure.states)},
    }


def _friction(exported: Exported) -> dict[str, str]:
    """Return what belongs to the sticking of dry friction, by mark; empty texts without it."""
    mode, velocity = exported.friction, held_velocity(exported)
    if mode is None:
        return dict.fromkeys(_OF_FRICTION, "")
    slopes = {slope_symbol(i): f"slopes({i + 1})" for i in range(len(exported.states))}
    lines = MATLAB.statements(["slip"], [slip_rate(exported)], {**_names(exported), **slopes})
    own = {
        "SLIP_RATE": "\n".join(lines),
        "STOP": _part("STOP") if velocity is None else _STOP_ONE,
        "VELOCITY": (velocity or 0) + 1,
        "FRICTION": mode + 1,
    }
    return {key: _part(key, own) for key in _OF_FRICTION}


def _body(
    target: str,
    expressions: Sequence[sp.Expr],
    names: Mapping[sp.Symbol, str],
    steps: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> str:
    targets = [f"{target}({i + 1})" for i in range(len(expressions))]
    return "\n".join(MATLAB.statements(targets, expressions, names, steps or {}))


def _pieces(exported: Exported, inputs: list[str]) -> str:
    lines: list[str] = []
    functions: dict[str, str] = {}
    for i, source in enumerate(exported.sources):
        kind = exported.hold if source.rate is None else "cubic"
        call = _CALLS[kind].format(*(quantity.name for quantity in source.quantities))
        lines.append(_PIECE.format(i=i + 1, call=call))
        functions[kind] = _part(kind)
    own = {
        "INPUTS": "".join(f", {name}" for name in inputs),
        "COUNT": len(lines),
        "LINES": "\n".join(lines),
        "FUNCTIONS": "".join(functions.values()),
    }
    return _part("ALL_PIECES", own)


def _limits(exported: Exported) -> str:
    own = _names(exported)
    names = {symbol: name.replace("p.", "m.p.").replace("x(", "m.x(") for symbol, name in own.items()}
    text = ""
    for i, limit in exported.limits.items():
        half = MATLAB.expression(limit, names)
        text += f"m.x({i + 1}) = min(max(m.x({i + 1}), -({half})), {half});\n"
    dependent = exported.frozen.dependent_modes
    if exported.limits and dependent:
        listed = ", ".join(str(i + 1) for i in dependent)
        text += _part("DEPENDENT", {"COUNT": len(dependent), "LISTED": listed})
    return text


def _rest(exported: Exported) -> str:
    rest = exported.rest
    if rest is None:
        return _part("NO_REST", {"N_STATES": len(exported.states)})
    if isinstance(rest, Balance):
        return _balance(exported, rest)
    values = MATLAB.statements(["x(1)", "inertia", "stiffness"], rest.expressions, _names(exported))
    own = {
        "N_STATES": len(exported.states),
        "VALUES": "\n".join(values),
        "DAMPING": rest.damping,
        "SILENCED": "".join(f"p.{name} = 0;\n" for name in rest.silenced),
        "VELOCITY": 1 + (exported.structure.velocity_index or 0),
    }
    return _part("REST", own)


def _balance(exported: Exported, rest: Balance) -> str:
    names, n = _names(exported), len(rest.unknown)
    targets = [f"r({i + 1})" for i in range(n)]
    targets += [f"s({i + 1}, {k + 1})" for i in range(n) for k in range(n)]
    starts = MATLAB.statements([f"x({i + 1})" for i in rest.start], list(rest.start.values()), names)
    return filled(
        template("export", "equilibrium.m.txt"),
        {
            "UNBALANCED": "\n".join(MATLAB.statements(targets, rest.expressions, names)),
            "START": "\n".join(starts),
            "UNKNOWN": ", ".join(str(i + 1) for i in rest.unknown),
            "N_UNKNOWN": n,
            "BALANCED": repr(BALANCED),
            "UNDER_INPUT": f"  error('{NO_START}');" if rest.remembers else "  x = balanced(p, first, x);",
            "N_STATES": len(exported.states),
        },
    )
