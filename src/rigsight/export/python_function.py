"""How does a model become one Python file that needs numpy and nothing else?"""

from __future__ import annotations

import keyword
from collections.abc import Mapping, Set

import sympy as sp

from rigsight.export.description import header_lines, indented
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
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.equilibrium import BALANCED
from rigsight.simulate.printing.language import PYTHON

WORDS = frozenset(keyword.kwlist)
"""Of the language."""
INPUT_WORDS = words("t n dt parameters initial_state PARAMETERS ValueError float list range zip")
"""Of the template where inputs are arguments and not read yet, beside what no name in any export is."""
_PIECES = {"zoh": "_steps({})", "foh": "_lines({}, dt)", "cubic": "_cubics({}, {}, dt)"}
_OWN_WORDS_OF_REST = words("first inertia stiffness")
"""Of `_REST` where parameters stand, beside what no name in any export is."""
_OWN_WORDS_OF_START = words("x any len ValueError")
"""The same of the template of the equilibrium of several motions."""


def python_function(exported: Exported, source: str) -> str:
    """Return the text of a Python file with a function ``simulate``."""
    structure, frozen, equations = exported.structure, exported.frozen, equations_of(exported)
    # What the template calls its own where parameters and states stand, beside what no name in any export is.
    counts = map(len, (frozen.rates, frozen.switches, structure.computed_outputs))
    own = frozenset({"slip_rate", "slopes", "result", *results(max(counts))})
    constants = constant_names(equations)
    names = code_names(exported, own) | constants
    modes = {mode: f"modes[{i}]" for i, mode in enumerate(frozen.modes)}
    every, shown = {**names, **modes}, {**names, frozen.friction_sign(0): "friction_sign"}
    inputs = [quantity.name for quantity in exported.inputs]
    unpack = unpacked_states(exported, own)
    slopes = {slope_symbol(i): f"slopes[{i}]" for i in range(len(exported.states))}
    slipping = PYTHON.statements(["result"], [slip_rate(exported)], {**names, **slopes})
    prepare = PYTHON.statements(list(constants.values()), list(equations.constants.values()), names)
    limits = [PYTHON.expression(limit, names) for limit in exported.limits.values()]
    fragments = {
        "HEADER": "\n".join(header_lines(exported, source)),
        "PARAMETERS": indented(parameter_entries(exported)),
        "STATES": sequence([repr(state.name) for state in exported.states]),
        "FRICTION": repr(exported.friction),
        "VELOCITY": repr(held_velocity(exported)),
        "DEPENDENT_MODES": sequence([str(i) for i in frozen.dependent_modes]),
        "LIMITED": sequence([str(i) for i in exported.limits]),
        "ARGUMENTS": "".join(f"{name}, " for name in inputs),
        "N_OUTPUTS": len(structure.computed_outputs),
        "UNPACK_PARAMETERS": indented([*unpacked_parameters(exported, own), *prepare]),
        "RATES": _returned(unpack, list(equations.rates), every, equations.steps),
        "SWITCHES": _returned(unpack, list(equations.switches), every),
        "OUTPUTS": _returned(unpack, list(equations.outputs), shown, equations.shown_steps),
        "SLIP_RATE": indented([*unpack, *slipping, "return result"], 2),
        "LIMITS": sequence(limits),
        "DELAY": _number(exported, structure.delay, "0.0"),
        "SENSOR_DELAY": _number(exported, structure.first_shown_late, "None"),
        "READ_SIGNS": "        motion.read_signs(piece, start + split, 0.0)"
        if exported.hold == "zoh"
        else "",
        "PIECES": _pieces(exported, inputs),
        "REST": _rest(exported),
        "OUTPUT_NAMES": sequence([repr(output.name) for output in exported.outputs]),
        "FIRST_OUTPUT": repr(exported.outputs[0].name),
        **fragments_of(exported),
    }
    text = filled(template("export", "model.py.txt"), fragments)
    return text.replace("else before\n\n        motion", "else before\n        motion")


def results(count: int) -> list[str]:
    """Return the names of so many results."""
    return [f"result{i}" for i in range(count)]


def code_names(exported: Exported, own: Set[str]) -> dict[sp.Symbol, str]:
    """Return the names of the symbols inside a function with names of its own, where inputs are elements of arrays."""
    local = local_names(exported, own)
    names = {symbol: local.get(name, name) for symbol, name in exported.names().items()}
    for index in range(len(exported.sources)):
        arrays = ("input_value", "input_rate", "input_curvature")
        names |= {s: f"{a}[{index}]" for s, a in zip(input_symbols(index), arrays, strict=True)}
    return names


def parameter_entries(exported: Exported) -> list[str]:
    """Return the lines of a dict of the parameters with their units."""
    return [f'"{q.name}": {value!r},  # [{q.unit}] {q.description}' for q, value in exported.numbers]


def unpacked_parameters(exported: Exported, own: Set[str]) -> list[str]:
    """Return statements that give every parameter its name inside a function with names of its own."""
    local = local_names(exported, own)
    return [f'{local[q.name]} = numbers["{q.name}"]' for q in exported.parameters]


def unpacked_states(exported: Exported, own: Set[str]) -> list[str]:
    """Return the statement that gives every state its name inside a function with names of its own."""
    local = local_names(exported, own)
    return [f"{sequence([local[q.name] for q in exported.states])} = state"] if exported.states else []


def sequence(items: list[str]) -> str:
    """Return items as the inside of a tuple."""
    return ", ".join(items) + ("," if len(items) == 1 else "")


def _returned(
    unpack: list[str],
    expressions: list[sp.Expr],
    names: Mapping[sp.Symbol, str],
    steps: Mapping[sp.Symbol, sp.Expr] | None = None,
) -> str:
    targets = results(len(expressions))
    lines = PYTHON.statements(targets, expressions, names, steps or {})
    return indented([*unpack, *lines, f"return [{', '.join(targets)}]"], 2)


def _number(exported: Exported, expression: sp.Expr | None, without: str) -> str:
    if expression is None:
        return indented([f"return {without}"])
    used = {exported.names()[symbol] for symbol in expression.free_symbols}
    lines = [f'{name} = numbers["{name}"]' for name in sorted(used)]
    return indented([*lines, f"return {PYTHON.expression(expression, exported.names())}"])


def _pieces(exported: Exported, inputs: list[str]) -> str:
    parts, lines = template_parts("export", "model_parts.py.txt"), list[str]()
    functions: dict[str, str] = {}
    for source in exported.sources:
        kind = exported.hold if source.rate is None else "cubic"
        lines.append(_PIECES[kind].format(*(quantity.name for quantity in source.quantities)))
        functions[kind] = parts[kind]
    body = f"return list(zip({', '.join(lines)}))" if lines else "return [()] * n"
    own = {
        "INPUTS": "".join(f", {name}" for name in inputs),
        "BODY": body,
        "FUNCTIONS": "\n\n\n".join(functions.values()),
    }
    return filled(parts["ALL_PIECES"], own).rstrip()


def _rest(exported: Exported) -> str:
    rest, parts = exported.rest, template_parts("export", "model_parts.py.txt")
    if rest is None:
        return parts["NO_REST"]
    if isinstance(rest, Balance):
        return _balance(exported, rest)
    names, local = exported.names(), local_names(exported, _OWN_WORDS_OF_REST)
    used = sorted({names[s] for expression in rest.expressions for s in expression.free_symbols})
    called = {s: local.get(name, name) for s, name in names.items()}
    values = PYTHON.statements(["state[0]", "inertia", "stiffness"], rest.expressions, called)
    own = {
        "UNPACK": indented([f'{local[name]} = numbers["{name}"]' for name in used]),
        "VALUES": indented(values),
        "DAMPING": rest.damping,
        "VELOCITY": exported.structure.velocity_index,
        "SILENCED": "".join(f', "{name}": 0.0' for name in rest.silenced),
    }
    return filled(parts["REST"], own)


def _balance(exported: Exported, rest: Balance) -> str:
    n = len(rest.unknown)
    targets = [f"r{i}" for i in range(n)] + [f"s{i}" for i in range(n * n)]
    own = frozenset(targets)
    lines = PYTHON.statements(targets, rest.expressions, code_names(exported, own))
    rows = ", ".join(f"[{', '.join(targets[n * (i + 1) : n * (i + 2)])}]" for i in range(n))
    result = f"return np.array([{', '.join(targets[:n])}]), np.array([{rows}])"
    lines = [*unpacked_parameters(exported, own), *unpacked_states(exported, own), *lines, result]
    called, places = code_names(exported, _OWN_WORDS_OF_START), [f"x[{i}]" for i in rest.start]
    starts = PYTHON.statements(places, list(rest.start.values()), called)
    if starts:
        starts = [*unpacked_parameters(exported, _OWN_WORDS_OF_START), *starts]
    refusal, balanced = f"raise ValueError({NO_START!r})", "x = _balanced(numbers, given, x)"
    fragments = {
        "UNBALANCED": indented(lines),
        "START": indented(starts),
        "UNKNOWN": ", ".join(map(str, rest.unknown)),
        "BALANCED": repr(BALANCED),
        "UNDER_INPUT": indented([refusal if rest.remembers else balanced], 2),
    }
    return filled(template("export", "equilibrium.py.txt"), fragments)


def local_names(exported: Exported, own: Set[str]) -> dict[str, str]:
    """Return what each parameter and state is called: as in the export, or one like it where the function needs that name."""
    # Others see the names of the export, so that a name used inside costs nobody his own.
    names = [quantity.name for quantity in (*exported.parameters, *exported.states)]
    taken, found = {*names, *own}, {}
    for name in names:
        found[name] = name
        while found[name] in own or (found[name] != name and found[name] in taken):
            found[name] += "_"
        taken.add(found[name])
    return found
