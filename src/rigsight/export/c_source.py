"""How does a model become one C99 file without dependencies? The kernel is that of the engine; the code that calls it is here."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

import sympy as sp

from rigsight.export.description import filled, header_lines, hold_text
from rigsight.export.equations import Exported
from rigsight.export.equilibrium import Balance
from rigsight.export.reserved_words import words
from rigsight.simulate.compiled.c_functions import FUNCTIONS
from rigsight.simulate.compiled.kernel_equations import KernelEquations
from rigsight.simulate.compiled.kernel_source import accurate_integrator
from rigsight.simulate.equations.structure import input_symbols
from rigsight.simulate.equilibrium import BALANCED
from rigsight.simulate.printing.c import C
from rigsight.simulate.rest import INTERVALS, RAMP_PERIODS, SETTLED, TOLERANCE, WAITS
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

_REST = """static piece constant(double value) {{
    return standing(&value);
}}

/* The input from `first` to `last` in a straight line, and then on. */
static piece linear(double first, double last, double dt) {{
    piece c = constant(first);
    c.c[0][1] = (last - first) / dt;
    return c;
}}

/* A ramp of the input from zero to `last` [s: length], and waits until nothing moves. */
static int settled(const parameters *p, double *x, double last, double length) {{
    const double h = length / {intervals}.0;
    double now[SIZE_STATES];
    long n = {intervals}, j;
    int wait, i;
    memcpy(now, x, sizeof now);
    for (wait = 0; wait < {waits}; wait++) {{
        const piece first = constant(wait == 0 ? 0.0 : last);
        motion own = started(p, now, &first, {tolerance!r});
        int status, still = 1;
        for (j = 0; j < n; j++) {{
            const double rise = wait == 0 ? last / {intervals}.0 : 0.0, from = wait == 0 ? (double)j * rise : last;
            piece c = linear(from, j + 1 == n ? last : from + rise, h);
            c.begin = (double)j * h;
            status = integrate(&own, &c, 0.0, h);
            if (status != OK) return status;
        }}
        if (!finite_states(&own)) return NOT_FINITE;
        for (i = 0; i < N_STATES; i++)
            still = still && (i == VELOCITY || fabs(own.x[i] - now[i]) <= {settled!r} * fabs(own.x[i]));
        memcpy(now, own.x, sizeof now);
        if (still) break;
        n = {intervals}L << wait;
    }}
    memcpy(x, now, sizeof now);
    x[VELOCITY] = 0.0;
    return OK;
}}

/* The static equilibrium at the first input, reached slowly from rest without memory. */
static void rest(const parameters *given, const double *u, double *x) {{
    const parameters *p = given;
    const double first = u[0];
    double stiffness, inertia, length;
{values}
    if (stiffness > 0.0) {{
        parameters quiet = *given;
        quiet.{damping} = larger(quiet.{damping}, 2.0 * sqrt(stiffness * inertia));
{silenced}        length = {ramp!r} * (2.0 * acos(-1.0) * sqrt(inertia / stiffness));
        if (settled(&quiet, x, 0.0, length) == OK && first != 0.0) settled(&quiet, x, first, length);
    }}
}}

"""
_REST_CALL = """    parameters numbers;
    if (p) numbers = *p; else {name}_defaults(&numbers);
    rest(&numbers, u, x);
"""
_BALANCE_CALL = """    parameters numbers;
    int status;
    if (p) numbers = *p; else {name}_defaults(&numbers);
    status = rest(&numbers, u, x);
    if (status != OK) return status;
"""
_HELD = {
    "zoh": "    c.c[{i}][0] = u[{at}];",
    "foh": "    c.c[{i}][0] = u[{at}];\n    c.c[{i}][1] = (next[{at}] - u[{at}]) / dt;",
}
_CUBIC = "    cubic(c.c[{i}], u + {at}, next + {at}, dt);"
_CUBICS = """/* A motion between values and rates at both ends. */
static void cubic(double *c, const double *u, const double *next, double dt) {
    const double rise = next[0] - u[0], first = u[1] * dt, last = next[1] * dt;
    c[0] = u[0];
    c[1] = u[1];
    c[2] = (3.0 * rise - 2.0 * first - last) / (dt * dt);
    c[3] = (first + last - 2.0 * rise) / (dt * dt * dt);
}

"""
_PROMPT = """    c.begin = m->t;
{read_signs}    status = integrate(&own, &c, 0.0, dt);
"""
_DELAYED = """    {{
        const double late = delay_of(own.q), whole = floor(late / dt);
        const double part = larger(late / dt - whole, 0.0), fraction = part > 1.0 ? 1.0 : part, split = fraction * dt;
        long back;
        if (late / dt > {upper}_HISTORY - 2) return {upper}_HISTORY_TOO_SHORT;
        back = (long)whole;
        memcpy(m->pieces[m->sample % {upper}_HISTORY], c.c, sizeof c.c);
        status = OK;
        if (fraction > 0.0) {{
            piece early = standing(m->first);
            if (m->sample > back) memcpy(early.c, m->pieces[(m->sample - back - 1) % {upper}_HISTORY], sizeof early.c);
            early.begin = m->t - (dt - split);
            own.fresh = 0;
            status = integrate(&own, &early, dt - split, dt);
        }}
        if (m->sample < back) c = standing(m->first);
        else memcpy(c.c, m->pieces[(m->sample - back) % {upper}_HISTORY], sizeof c.c);
        c.begin = m->t + split;
        if (fraction > 0.0) own.fresh = 0;
{read_signs}        if (status == OK) status = integrate(&own, &c, 0.0, dt - split);
    }}
"""
_CONSTANT_STEP = "        if (m->sample > 0) return {upper}_STEP_CHANGED;\n"
_REMEMBER = """/* The first output and its rate, which a late sensor will show. */
static void remember(model *m) {{
    double all[N_COMPUTED];
    compute(m, all);
    m->readings[m->sample % {upper}_HISTORY][0] = all[0];
    m->readings[m->sample % {upper}_HISTORY][1] = all[N_COMPUTED - 1];
}}

static double sensor_delay(const parameters *p) {{
    return {late};
}}

"""
_LATE_HISTORY = "    if (sensor_delay(&m->p) / dt > {upper}_HISTORY - 2) return {upper}_HISTORY_TOO_SHORT;\n"
_AS_MEASURED = """    {{
        /* The first output is read late: cubic Hermite interpolation, before the start the motion went on as it started. */
        const double late = sensor_delay(&m->p), dt = m->dt;
        if (m->sample == 0 || late > (double)m->sample * dt) {{
            y[0] = m->origin[0] + m->origin[1] * ((double)m->sample * dt - late);
        }} else {{
            const double place = (double)m->sample - late / dt;
            const long floored = (long)larger(floor(place), 0.0), start = floored < m->sample ? floored : m->sample - 1;
            const double *first = m->readings[start % {upper}_HISTORY], *last = m->readings[(start + 1) % {upper}_HISTORY];
            const double s = place - (double)start, a = first[0], b = last[0], va = first[1] * dt, vb = last[1] * dt;
            y[0] = a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb)));
        }}
    }}
"""


def macros(name: str) -> frozenset[str]:
    """Return the macros of a file, which replace even the names of members."""
    own = "ACCURACY DECLARATIONS DECLARED HISTORY MAIN N_INPUTS N_OUTPUTS N_STATES"
    return _MACROS_OF_HEADERS | {f"{name.upper()}_{word}" for word in own.split()}


def c_source(exported: Exported, source: str, name: str) -> str:
    """Return the text of a C file."""
    structure, upper = exported.structure, name.upper()
    equations = KernelEquations(structure)
    delayed, late = structure.delay is not None, structure.first_shown_late is not None
    read_signs = "    read_signs(&own, &c, 0.0);\n" if exported.hold == "zoh" else ""
    names = _parameter_names(exported)
    inputs = ["t", *(quantity.name for quantity in exported.inputs)]
    outs = [quantity.name for quantity in exported.outputs]
    room = max(1, len(exported.inputs))
    kernel = "\n".join(
        [equations.text("const parameters *p", list(names.values())), accurate_integrator(equations)]
    )
    rest = _rest(exported, names).replace("<<UPPER>>", upper)
    fragments = {
        "HEADER": "\n".join(
            f" * {line}".rstrip() for line in header_lines(exported, source, with_parameters=False)
        ),
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
        "FUNCTIONS": _missing_functions(kernel, rest),
        "STANDING": "\n".join(f"    c.c[{i}][0] = u[{at}];" for i, at in enumerate(_places(exported))),
        "REST": rest,
        "REST_CALL": _rest_call(exported).format(name=name),
        "DEFAULTS": "\n".join(
            f"    p->{q.name} = {value!r};"
            for q, value in zip(exported.parameters, exported.values, strict=True)
        ),
        "REMEMBER_FIRST": ("    memcpy(m->first, u, sizeof m->first);\n" if delayed else "")
        + ("    remember(m);\n    memcpy(m->origin, m->readings[0], sizeof m->origin);\n" if late else ""),
        "CUBIC": _CUBICS if exported.follows_motion else "",
        "PIECE": _piece(exported),
        "SAME_STEP": _SAME_STEP[delayed or late],
        "STEP_CHANGED": _CONSTANT_STEP.format(upper=upper) if delayed or late else "",
        "ADVANCE": (_LATE_HISTORY.format(upper=upper) if late else "")
        + (
            _DELAYED.format(upper=upper, read_signs=f"    {read_signs}" if read_signs else "")
            if delayed
            else _PROMPT.format(read_signs=read_signs)
        ),
        "RATES_AT_SAMPLE": "".join(
            f"    c.c[{i}][1] = m->u[{at + 1}];\n"
            for i, (at, source) in enumerate(zip(_places(exported), exported.sources, strict=True))
            if source.rate is not None
        ),
        "REMEMBER": _REMEMBER.format(upper=upper, late=C.expression(structure.first_shown_late, names))
        if late
        else "",
        "REMEMBER_CALL": "    remember(m);\n" if late else "",
        "AS_MEASURED": _AS_MEASURED.format(upper=upper) if late else "",
        "UPPER": upper,
        "NAME": name,
    }
    text = files("rigsight.export").joinpath("templates/model.c.txt").read_text("utf-8")
    return filled(text, fragments)


def _parameter_names(exported: Exported) -> dict[sp.Symbol, str]:
    """Return how each parameter is written; their names are words of no language and of no part of the file."""
    pairs = zip(exported.structure.parameter_symbols, exported.parameters, strict=True)
    return {symbol: f"p->{quantity.name}" for symbol, quantity in pairs}


def _memory(exported: Exported, equations: KernelEquations) -> int:
    """Return how many numbers the integrator keeps between samples."""
    states, modes = max(1, len(exported.states)), max(1, len(exported.frozen.modes))
    inputs, frictions = max(1, len(exported.inputs)), max(1, len(exported.frozen.frictions))
    watched = len(exported.frozen.modes) + 2 * len(exported.frozen.frictions) + 1
    constants = max(1, len(equations.constants))
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


def _missing_functions(kernel: str, rest: str) -> str:
    """Return the functions that the equilibrium calls and the kernel has not written."""
    lacking = [text for name, text in FUNCTIONS.items() if f"{name}(" in rest and text not in kernel]
    return "".join(f"{text}\n" for text in lacking)


def _rest_call(exported: Exported) -> str:
    if exported.rest is None:
        return "    (void)p; (void)u;\n"
    return _BALANCE_CALL if isinstance(exported.rest, Balance) else _REST_CALL


def _rest(exported: Exported, names: Mapping[sp.Symbol, str]) -> str:
    """Return the functions that find the equilibrium at the first inputs; nothing for a model without a state of its own."""
    rest = exported.rest
    if isinstance(rest, Balance):
        return _balance(exported, rest, names)
    if rest is None:
        return ""
    wanted = {"x[0]": rest.displacement, "inertia": rest.inertia, "stiffness": rest.stiffness}
    return _REST.format(
        intervals=INTERVALS,
        waits=WAITS,
        tolerance=TOLERANCE,
        settled=SETTLED,
        ramp=RAMP_PERIODS,
        values="\n".join(f"    {line}" for line in C.statements(list(wanted), list(wanted.values()), names)),
        damping=rest.damping,
        silenced="".join(f"        quiet.{name} = 0.0;\n" for name in rest.silenced),
    )


def _balance(exported: Exported, rest: Balance, parameters: Mapping[sp.Symbol, str]) -> str:
    states = exported.structure.states
    names = {
        **parameters,
        **{symbol: f"x[{i}]" for i, symbol in enumerate(states)},
        **{input_symbols(i)[0]: f"u[{at}]" for i, at in enumerate(_places(exported))},
    }
    targets = [f"r[{i}]" for i in range(len(rest.residuals))]
    targets += [f"s[{i}]" for i in range(len(rest.unknown) ** 2)]
    expressions = [*rest.residuals, *(slope for row in rest.slopes for slope in row)]
    starts = C.statements([f"x[{i}]" for i in rest.start], list(rest.start.values()), names)
    unread = " ".join(f"(void){name};" for name in ("p", "u", "x"))
    text = files("rigsight.export").joinpath("templates/equilibrium.c.txt").read_text("utf-8")
    return filled(
        text,
        {
            "UNBALANCED": "\n".join(
                f"    {line}" for line in [unread, *C.statements(targets, expressions, names)]
            ),
            "START": "\n".join(f"    {line}" for line in starts),
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
