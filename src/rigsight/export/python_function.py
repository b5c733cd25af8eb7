"""How does a model become one Python file that needs numpy and nothing else?"""

from __future__ import annotations

import keyword
from collections.abc import Mapping, Set
from importlib.resources import files

import sympy as sp

from rigsight.export.description import filled, header_lines, hold_text, indented
from rigsight.export.equations import Exported
from rigsight.export.equilibrium import NO_START, Balance
from rigsight.export.friction import friction_mode, friction_sign, held_velocity, slip_rate, slope_symbol
from rigsight.export.internal_step import is_linear
from rigsight.export.precomputed import constant_names, equations_of
from rigsight.export.reserved_words import words
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.equilibrium import BALANCED
from rigsight.simulate.printing.language import PYTHON

WORDS = frozenset(keyword.kwlist)
"""Of the language."""
INPUT_WORDS = words("t n dt parameters initial_state PARAMETERS ValueError float list range zip")
"""Of the template where inputs are arguments and not read yet, beside what no name in any export is."""
MIN_STEPS = 4
"""Steps per sample of a model with kinks or products, whose time scales depend on the motion."""
MIN_STEPS_PRESCRIBED = 32
"""The same if the motion is prescribed: the model has no time scale that requires more."""

_PIECES = {
    "zoh": "_steps({name})",
    "foh": "_lines({name}, dt)",
}
_CUBIC = "_cubics({value}, {rate}, dt)"
_HOLDS = {
    "zoh": """def _steps(samples):
    return [(float(value), 0.0, 0.0, 0.0) for value in samples]""",
    "foh": """def _lines(samples, dt):
    samples = [float(value) for value in samples]
    slopes = [(b - a) / dt for a, b in zip(samples, samples[1:])] + [0.0]
    return [(value, slope, 0.0, 0.0) for value, slope in zip(samples, slopes)]""",
}
_CUBICS = """def _cubics(values, rates, dt):
    x, v = np.append(np.asarray(values, dtype=float), 0.0), np.append(np.asarray(rates, dtype=float), 0.0)
    rise, first, last = np.diff(x), v[:-1] * dt, v[1:] * dt
    c2 = (3.0 * rise - 2.0 * first - last) / dt**2
    c3 = (first + last - 2.0 * rise) / dt**3
    return list(zip(x[:-1].tolist(), v[:-1].tolist(), c2.tolist(), c3.tolist()))"""
_ALL_PIECES = '''def _pieces(n, dt{inputs}):
    """Return the inputs between samples, each as a cubic (c0, c1, c2, c3) of the time since the sample [s]."""
    {body}


{functions}'''
_REST = '''def _rest(numbers, given):
    """Return the static equilibrium at the first input, reached slowly from rest without memory."""
    first = given[0]
{unpack}
    state = [0.0] * N_STATES
{values}
    if stiffness <= 0.0:
        return state
    damping = max(numbers["{damping}"], 2.0 * math.sqrt(stiffness * inertia))
    quiet = {{**numbers, "{damping}": damping{silenced}}}
    length = 40.0 * math.pi * math.sqrt(inertia / stiffness)
    for last in (0.0, first) if first != 0.0 else (0.0,):
        try:
            state = _settled(quiet, state, last, length)
        except ArithmeticError:
            break
    return state


def _settled(numbers, state, last, length):
    """Return the states after a ramp of the input from zero, and waits until nothing moves."""
    piece, duration = [(0.0, last / length, 0.0, 0.0)], length
    for wait in range(7):
        motion = _Motion(numbers, state)
        motion.read_signs(piece, 0.0, 0.0)
        if last == 0.0 and not any(motion.slopes(piece, 0.0, 0.0, motion.x)):
            return state
        motion.advance(piece, 0.0, 0.0, duration)
        if not all(map(math.isfinite, motion.x)):
            raise ArithmeticError("no equilibrium")
        still = all(
            abs(new - old) <= 1e-9 * abs(new)
            for i, (new, old) in enumerate(zip(motion.x, state))
            if i != {velocity}
        )
        state = motion.x
        if still:
            break
        piece, duration = [(last, 0.0, 0.0, 0.0)], length * 2.0**wait
    state[{velocity}] = 0.0
    return state'''
_OWN_WORDS_OF_REST = words("first inertia stiffness")
"""Of `_REST` where parameters stand, beside what no name in any export is."""
_NO_REST = '''def _rest(numbers, given):
    """Return the states without memory."""
    return [0.0] * N_STATES'''
_OWN_WORDS_OF_START = words("x any len ValueError")
"""The same of the template of the equilibrium of several motions."""


def min_steps(exported: Exported) -> int:
    """Return how many internal steps a sample has at least: 1 where the equations are linear."""
    if not exported.states or is_linear(exported.frozen, exported.structure):
        return 1
    return MIN_STEPS_PRESCRIBED if exported.follows_motion else MIN_STEPS


def python_function(exported: Exported, source: str) -> str:
    """Return the text of a Python file with a function ``simulate``."""
    structure, frozen, equations = exported.structure, exported.frozen, equations_of(exported)
    own = _own_words_of_equations(exported)
    constants = constant_names(equations)
    names = code_names(exported, own) | constants
    modes = {mode: f"modes[{i}]" for i, mode in enumerate(frozen.modes)}
    every = {**names, **modes}
    inputs = [quantity.name for quantity in exported.inputs]
    unpack = unpacked_states(exported, own)
    limits = [PYTHON.expression(limit, names) for limit in exported.limits.values()]
    template = files("rigsight.export").joinpath("templates/model.py.txt").read_text("utf-8")
    fragments = {
        "TITLE": f"Simulation of {exported.title}",
        "HEADER": "\n".join(header_lines(exported, source, with_parameters=False)),
        "PARAMETERS": indented(parameter_entries(exported)),
        "STATES": sequence([repr(state.name) for state in exported.states]),
        "STEP": repr(exported.step),
        "MIN_STEPS": min_steps(exported),
        "FRICTION": repr(friction_mode(exported)),
        "VELOCITY": repr(held_velocity(exported)),
        "N_STATES": len(exported.states),
        "N_MODES": len(frozen.modes),
        "DEPENDENT_MODES": sequence([str(i) for i in frozen.dependent_modes]),
        "LIMITED": sequence([str(i) for i in exported.limits]),
        "ARGUMENTS": "".join(f"{name}, " for name in inputs),
        "MORE_INPUTS": "".join(f", {name}" for name in inputs),
        "HOLD_TEXT": hold_text(exported),
        "N_OUTPUTS": len(structure.computed_outputs),
        "UNPACK_PARAMETERS": indented(
            [
                *unpacked_parameters(exported, own),
                *PYTHON.statements(list(constants.values()), list(equations.constants.values()), names),
            ]
        ),
        "RATES": _returned(unpack, list(equations.rates), every, equations.steps),
        "SWITCHES": _returned(unpack, list(equations.switches), every),
        "OUTPUTS": _returned(
            unpack,
            list(equations.outputs),
            {**names, friction_sign(exported): "friction_sign"},
            equations.shown_steps,
        ),
        "SLIP_RATE": _returned_one(unpack, slip_rate(exported), {**names, **_slopes(exported)}),
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
    }
    text = filled(template, fragments)
    return text.replace("else before\n\n        motion", "else before\n        motion")


def _own_words_of_equations(exported: Exported) -> frozenset[str]:
    """Return what the template calls its own where parameters and states stand, beside what no name in any export is."""
    counts = map(len, (exported.frozen.rates, exported.frozen.switches, exported.structure.computed_outputs))
    return frozenset({"slip_rate", "slopes", "result", *results(max(counts))})


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
    pairs = zip(exported.parameters, exported.values, strict=True)
    return [f'"{q.name}": {value!r},  # [{q.unit}] {q.description}' for q, value in pairs]


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


def _returned_one(unpack: list[str], expression: sp.Expr, names: Mapping[sp.Symbol, str]) -> str:
    lines = PYTHON.statements(["result"], [expression], names)
    return indented([*unpack, *lines, "return result"], 2)


def _slopes(exported: Exported) -> dict[sp.Symbol, str]:
    return {slope_symbol(i): f"slopes[{i}]" for i in range(len(exported.states))}


def _pieces(exported: Exported, inputs: list[str]) -> str:
    lines: list[str] = []
    functions: dict[str, str] = {}
    for source in exported.sources:
        if source.rate is None:
            lines.append(_PIECES[exported.hold].format(name=source.value.name))
            functions[exported.hold] = _HOLDS[exported.hold]
        else:
            lines.append(_CUBIC.format(value=source.value.name, rate=source.rate.name))
            functions["cubic"] = _CUBICS
    body = f"return list(zip({', '.join(lines)}))" if lines else "return [()] * n"
    more = "".join(f", {name}" for name in inputs)
    return _ALL_PIECES.format(inputs=more, body=body, functions="\n\n\n".join(functions.values())).rstrip()


def _rest(exported: Exported) -> str:
    rest = exported.rest
    if rest is None:
        return _NO_REST
    if isinstance(rest, Balance):
        return _balance(exported, rest)
    wanted = {"state[0]": rest.displacement, "inertia": rest.inertia, "stiffness": rest.stiffness}
    names, local = exported.names(), local_names(exported, _OWN_WORDS_OF_REST)
    used = sorted({names[s] for expression in wanted.values() for s in expression.free_symbols})
    return _REST.format(
        unpack=indented([f'{local[name]} = numbers["{name}"]' for name in used]),
        values=indented(
            PYTHON.statements(
                list(wanted), list(wanted.values()), {s: local.get(name, name) for s, name in names.items()}
            )
        ),
        damping=rest.damping,
        velocity=exported.structure.velocity_index,
        silenced="".join(f', "{name}": 0.0' for name in rest.silenced),
    )


def _balance(exported: Exported, rest: Balance) -> str:
    n = len(rest.unknown)
    targets = [f"r{i}" for i in range(n)] + [f"s{i}" for i in range(n * n)]
    own = frozenset(targets)
    lines = PYTHON.statements(
        targets,
        [*rest.residuals, *(slope for row in rest.slopes for slope in row)],
        code_names(exported, own),
    )
    rows = ", ".join(f"[{', '.join(targets[n * (i + 1) : n * (i + 2)])}]" for i in range(n))
    result = f"return np.array([{', '.join(targets[:n])}]), np.array([{rows}])"
    starts = PYTHON.statements(
        [f"x[{i}]" for i in rest.start], list(rest.start.values()), code_names(exported, _OWN_WORDS_OF_START)
    )
    text = files("rigsight.export").joinpath("templates/equilibrium.py.txt").read_text("utf-8")
    return filled(
        text,
        {
            "UNBALANCED": indented(
                [*unpacked_parameters(exported, own), *unpacked_states(exported, own), *lines, result]
            ),
            "START": indented(
                [*(unpacked_parameters(exported, _OWN_WORDS_OF_START) if starts else ()), *starts]
            ),
            "UNKNOWN": ", ".join(map(str, rest.unknown)),
            "BALANCED": repr(BALANCED),
            "UNDER_INPUT": f"        raise ValueError({NO_START!r})"
            if rest.remembers
            else "        x = _balanced(numbers, given, x)",
        },
    )


def local_names(exported: Exported, own: Set[str]) -> dict[str, str]:
    """Return what each parameter and state is called: as in the export, or one like it where the function needs that name.

    Others see the names of the export, so that a name used inside costs nobody his own.
    """
    names = [quantity.name for quantity in (*exported.parameters, *exported.states)]
    taken, found = {*names, *own}, {}
    for name in names:
        found[name] = name
        while found[name] in own or (found[name] != name and found[name] in taken):
            found[name] += "_"
        taken.add(found[name])
    return found
