"""How does a model become one C99 file without dependencies? The kernel is that of the engine; the code that calls it is here."""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from rigsight.export.description import header_lines, hold_text, indented
from rigsight.export.equations import Balance, Exported, words
from rigsight.libraries.templates import filled, template, template_parts
from rigsight.simulate.compiled.kernel_equations import KernelEquations
from rigsight.simulate.compiled.kernel_source import accurate_integrator
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.equilibrium import BALANCED, INTERVALS, RAMP_PERIODS, SETTLED, TOLERANCE, WAITS
from rigsight.simulate.printing.language import FUNCTIONS, C
from rigsight.simulate.simulation import DEFAULT_ACCURACY, LOCAL_PER_GLOBAL

_MACROS_OF_HEADERS = words(
    """BIG_ENDIAN BYTE_ORDER DOMAIN FD_SETSIZE FP_ILOGB0 FP_ILOGBNAN HUGE LITTLE_ENDIAN L_ctermid MAXFLOAT MB_CUR_MAX M_1_PI
    M_2_PI M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2 NFDBITS OVERFLOW PDP_ENDIAN PLOSS
    P_tmpdir SING TLOSS UNDERFLOW WCONTINUED WEXITED WNOHANG WNOWAIT WSTOPPED WUNTRACED"""
)
"""What compilers define beyond the standard, beside what no name in any export is."""
HISTORY = 4096
"""Samples that a delay may last; more cost memory in every instance."""
_SPARE = 8
"""Numbers of the integrator beside those that are counted; the compiler checks that they have room."""
_SAME_STEP = {False: "1e-9", True: "1e-6"}
"""By which part two sample times may differ and be one: without and with a delay, which needs them to be."""

_HELD = {
    "zoh": "    c.c[{i}][0] = u[{at}];",
    "foh": "    c.c[{i}][0] = u[{at}];\n    c.c[{i}][1] = (next[{at}] - u[{at}]) / dt;",
}
_CUBIC = "    cubic(c.c[{i}], u + {at}, next + {at}, dt);"
_CONSTANT_STEP = "        if (m->sample > 0) return <<UPPER>>_STEP_CHANGED;\n"
_LATE_HISTORY = (
    "    if (sensor_delay(&m->p) / dt > <<UPPER>>_HISTORY - 2) return <<UPPER>>_HISTORY_TOO_SHORT;\n"
)


def macros(name: str) -> frozenset[str]:
    """Return the macros of a file, which replace even the names of members."""
    own = "ACCURACY DECLARATIONS DECLARED HISTORY MAIN N_INPUTS N_OUTPUTS N_STATES"
    return _MACROS_OF_HEADERS | {f"{name.upper()}_{word}" for word in own.split()}


def c_source(exported: Exported, source: str, name: str) -> str:
    """Return the text of a C file."""
    structure, upper = exported.structure, name.upper()
    equations = KernelEquations(structure)
    delayed, late = structure.delay is not None, structure.first_shown_late is not None
    # Their names are words of no language and of no part of the file.
    pairs = zip(structure.parameter_symbols, exported.parameters, strict=True)
    names = {symbol: f"p->{quantity.name}" for symbol, quantity in pairs}
    inputs = ["t", *(quantity.name for quantity in exported.inputs)]
    outs = [quantity.name for quantity in exported.outputs]
    room = max(1, len(exported.inputs))
    computed = equations.text("const parameters *p", list(names.values()))
    kernel = f"{computed}\n{accurate_integrator(equations)}"
    rest, parts = _rest(exported, names), template_parts("export", "model_parts.c.txt")
    lacking = (text for name, text in FUNCTIONS.items() if f"{name}(" in rest and text not in kernel)
    fragments = {
        "HEADER": "\n".join(f" * {line}".rstrip() for line in header_lines(exported, source)),
        "TITLE": f"Simulation of {exported.title}",
        "HOLD_TEXT": hold_text(exported),
        "COLUMNS": ",".join(inputs),
        "WRITTEN": ",".join(["t", *outs]),
        "INPUT_TEXT": ", ".join(inputs[1:]),
        "OUTPUT_TEXT": ", ".join(outs),
        "STATE_TEXT": ", ".join(state.name for state in exported.states) or "none",
        "COUNT_STATES": len(exported.states),
        "COUNT_ROOM": max(1, len(exported.states)),
        "N_INPUTS": len(exported.inputs),
        "ROOM_INPUTS": room,
        "N_OUTPUTS": len(outs),
        "ACCURACY": repr(DEFAULT_ACCURACY),
        "LOCAL_PER_GLOBAL": repr(LOCAL_PER_GLOBAL),
        "HISTORY": HISTORY,
        "MEMORY": _memory(exported, equations),
        "PARAMETER_MEMBERS": "\n".join(
            f"    double {q.name};  /* [{q.unit}] {q.description} */" for q in exported.parameters
        ),
        "HISTORY_MEMBERS": (
            f"    double first[{room}], pieces[{upper}_HISTORY][{len(exported.sources)}][4];\n"
            if delayed
            else ""
        )
        + (f"    double origin[2], readings[{upper}_HISTORY][2];\n" if late else ""),
        "KERNEL": kernel,
        "FUNCTIONS": "".join(f"{text}\n" for text in lacking),
        "STANDING": "\n".join(f"    c.c[{i}][0] = u[{at}];" for i, at in enumerate(_places(exported))),
        "REST": rest,
        "REST_CALL": "    (void)p; (void)u;\n"
        if exported.rest is None
        else parts["BALANCE_CALL" if isinstance(exported.rest, Balance) else "REST_CALL"],
        "DEFAULTS": "\n".join(f"    p->{q.name} = {value!r};" for q, value in exported.numbers),
        "REMEMBER_FIRST": ("    memcpy(m->first, u, sizeof m->first);\n" if delayed else "")
        + ("    remember(m);\n    memcpy(m->origin, m->readings[0], sizeof m->origin);\n" if late else ""),
        "CUBIC": parts["CUBICS"] if exported.follows_motion else "",
        "PIECE": _piece(exported),
        "SAME_STEP": _SAME_STEP[delayed or late],
        "STEP_CHANGED": _CONSTANT_STEP if delayed or late else "",
        "ADVANCE": (_LATE_HISTORY if late else "") + parts["DELAYED" if delayed else "PROMPT"],
        "READ_SIGNS": "    " * delayed + "    read_signs(&own, &c, 0.0);\n" if exported.hold == "zoh" else "",
        "RATES_AT_SAMPLE": "".join(
            f"    c.c[{i}][1] = m->u[{at + 1}];\n"
            for i, (at, source) in enumerate(zip(_places(exported), exported.sources, strict=True))
            if source.rate is not None
        ),
        "REMEMBER": parts["REMEMBER"] if late else "",
        "LATE": C.expression(structure.first_shown_late, names) if late else "",
        "REMEMBER_CALL": "    remember(m);\n" if late else "",
        "AS_MEASURED": parts["AS_MEASURED"] if late else "",
        "UPPER": upper,
        "NAME": name,
    }
    return filled(template("export", "model.c.txt"), fragments)


def _memory(exported: Exported, equations: KernelEquations) -> int:
    """Return how many numbers the integrator keeps between samples."""
    frozen = exported.frozen
    counted = (exported.states, exported.inputs, frozen.modes, frozen.frictions, equations.constants)
    states, inputs, modes, frictions, constants = (max(1, len(own)) for own in counted)
    watched = len(frozen.modes) + 2 * len(frozen.frictions) + 1
    return 5 * states + modes + 2 * watched + constants + inputs + 2 * frictions + _SPARE


def _places(exported: Exported) -> list[int]:
    """Return where in a row of inputs each of the rig's begins: behind a prescribed motion stands its rate."""
    counts = [len(source.quantities) for source in exported.sources]
    return [sum(counts[:i]) for i in range(len(counts))]


def _piece(exported: Exported) -> str:
    lines = [
        (_HELD[exported.hold] if source.rate is None else _CUBIC).format(i=i, at=at)
        for i, (at, source) in enumerate(zip(_places(exported), exported.sources, strict=True))
    ]
    unread = [name for name in ("next", "dt") if not any(name in line for line in lines)]
    return "\n".join([*(f"    (void){name};" for name in unread), *lines])


def _rest(exported: Exported, names: Mapping[sp.Symbol, str]) -> str:
    """Return the functions that find the equilibrium at the first inputs; nothing for a model without a state of its own."""
    rest = exported.rest
    if isinstance(rest, Balance):
        return _balance(exported, rest, names)
    if rest is None:
        return ""
    values = C.statements(["x[0]", "inertia", "stiffness"], rest.expressions, names)
    silenced = "".join(f"        quiet.{name} = 0.0;\n" for name in rest.silenced)
    own = {"VALUES": indented(values), "DAMPING": rest.damping, "SILENCED": silenced}
    fixed = {
        "INTERVALS": INTERVALS,
        "WAITS": WAITS,
        "TOLERANCE": TOLERANCE,
        "SETTLED": SETTLED,
        "RAMP": RAMP_PERIODS,
    }
    return filled(template_parts("export", "model_parts.c.txt")["REST"], {**fixed, **own})


def _balance(exported: Exported, rest: Balance, parameters: Mapping[sp.Symbol, str]) -> str:
    names = dict(parameters) | {symbol: f"x[{i}]" for i, symbol in enumerate(exported.structure.states)}
    names |= {input_symbols(i)[0]: f"u[{at}]" for i, at in enumerate(_places(exported))}
    targets = [f"r[{i}]" for i in range(len(rest.residuals))]
    targets += [f"s[{i}]" for i in range(len(rest.unknown) ** 2)]
    starts = C.statements([f"x[{i}]" for i in rest.start], list(rest.start.values()), names)
    unread = " ".join(f"(void){name};" for name in ("p", "u", "x"))
    return filled(
        template("export", "equilibrium.c.txt"),
        {
            "UNBALANCED": indented([unread, *C.statements(targets, rest.expressions, names)]),
            "START": indented(starts),
            "UNKNOWN": ", ".join(map(str, rest.unknown)),
            "N_UNKNOWN": len(rest.unknown),
            "BALANCED": repr(BALANCED),
            "VALUES": ", ".join(map(str, _places(exported))) or "0",
            "ROOM_INPUTS": max(1, len(exported.inputs)),
            "UNDER_INPUT": "    return <<UPPER>>_NO_START;"
            if rest.remembers
            else "    balance(p, u, x);\n    return OK;",
        },
    )
