"""How does a model become one C99 file without dependencies?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files

import sympy as sp

from rigsight.export.description import filled, header_lines, hold_text
from rigsight.export.equations import Exported
from rigsight.export.languages import C
from rigsight.export.precomputed import Equations, equations_of
from rigsight.export.python_function import min_steps
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME

HISTORY = 4096
"""Samples that a delay may last; more cost memory in every instance."""

_SIGN_OF = (
    "static double sign_of(double value) { return value > 0.0 ? 1.0 : (value < 0.0 ? -1.0 : 0.0); }\n\n"
)
_SWITCHES = """static void switches(const parameters *p, const double *q, instant at, const double *x, const double *s,
                     double *g) {{
{body}
}}

"""
_REST = """/* A ramp of the input from zero to `last`, and waits until nothing moves. */
static int settled(model *m, double last, double length) {{
    piece c = constant(0.0);
    double duration = length, before[SIZE_STATES];
    int wait, i, still, status;
    c.c[1] = last / length;
    for (wait = 0; wait < 7; wait++) {{
        memcpy(before, m->x, sizeof before);
        clear(m, m->u);
        read_signs(m, &c, 0.0);
        if (last == 0.0) {{
            double k[SIZE_STATES];
            slopes(m, &c, 0.0, m->x, k);
            for (i = 0, still = 1; i < N_STATES; i++) still = still && k[i] == 0.0;
            if (still) return {upper}_OK;
        }}
        status = advance(m, &c, 0.0, duration);
        if (status != {upper}_OK || !finite_states(m)) {{
            memcpy(m->x, before, sizeof before);
            return {upper}_NOT_FINITE;
        }}
        for (i = 0, still = 1; i < N_STATES; i++)
            still = still && (i == VELOCITY || fabs(m->x[i] - before[i]) <= 1e-9 * fabs(m->x[i]));
        if (still) break;
        c = constant(last);
        duration = length * pow(2.0, wait);
    }}
    m->x[VELOCITY] = 0.0;
    return {upper}_OK;
}}

/* The static equilibrium at the first input, reached slowly from rest without memory. */
static void rest(model *m, const parameters *given, const double *u, double *x) {{
    const parameters *p = given;
    double stiffness, inertia, length;
    m->p = *p;
    memset(m->x, 0, sizeof m->x);
    clear(m, u);
{values}
    if (stiffness > 0.0) {{
        m->p.{damping} = fmax(m->p.{damping}, 2.0 * sqrt(stiffness * inertia));
{silenced}        prepare(m);
        length = 40.0 * acos(-1.0) * sqrt(inertia / stiffness);
        if (settled(m, 0.0, length) == {upper}_OK && u[0] != 0.0) settled(m, u[0], length);
    }}
    memcpy(x, m->x, sizeof m->x);
}}

"""
_REST_CALL = """    parameters numbers;
    if (p) numbers = *p; else {name}_defaults(&numbers);
    rest(m, &numbers, u, x);
"""
_PIECES = {
    "zoh": "    (void)next;\n",
    "foh": "    c.c[1] = (next[0] - u[0]) / dt;\n",
}
_MOTION_PIECE = """    c.c[1] = u[1];
    c.c[2] = (3.0 * (next[0] - u[0]) - (2.0 * u[1] + next[1]) * dt) / (dt * dt);
    c.c[3] = ((u[1] + next[1]) * dt - 2.0 * (next[0] - u[0])) / (dt * dt * dt);
"""
_CONSTANT_STEP = """    if (m->dt == 0.0) m->dt = dt;
    if (fabs(dt - m->dt) > 1e-6 * m->dt) return {upper}_STEP_CHANGED;
    dt = m->dt;
"""
_DELAYED = """    {{
        const parameters *p = &m->p;
        const double late = {delay};
        const double whole = floor(late / dt), split = (late / dt - whole) * dt;
        const long back = (long)whole;
        if (late / dt > {upper}_HISTORY - 2) return {upper}_HISTORY_TOO_SHORT;
        memcpy(m->pieces[m->sample % {upper}_HISTORY], c.c, sizeof c.c);
        status = {upper}_OK;
        if (split > 0.0) {{
            piece early = constant(m->first);
            if (m->sample > back) memcpy(early.c, m->pieces[(m->sample - back - 1) % {upper}_HISTORY], sizeof early.c);
            early.begin = m->t - (dt - split);
            status = advance(m, &early, dt - split, dt);
        }}
        if (m->sample < back) c = constant(m->first);
        else memcpy(c.c, m->pieces[(m->sample - back) % {upper}_HISTORY], sizeof c.c);
        c.begin = m->t + split;
{read_signs}        if (status == {upper}_OK) status = advance(m, &c, 0.0, dt - split);
    }}
"""
_PROMPT = """    c.begin = m->t;
{read_signs}    status = advance(m, &c, 0.0, dt);
"""
_REMEMBER = """    {{
        double all[N_COMPUTED];
        instant at = {{0.0, 0.0, 0.0}};
        at.value = m->u[0];
        at.time = m->t;
        computed(&m->p, m->q, at, m->x, all);
        m->readings[m->sample % {upper}_HISTORY][0] = all[0];
        m->readings[m->sample % {upper}_HISTORY][1] = all[N_COMPUTED - 1];
    }}
"""
_LATE_HISTORY = """    {
        const parameters *p = &m->p;
        if ((%(late)s) / dt > %(upper)s_HISTORY - 2) return %(upper)s_HISTORY_TOO_SHORT;
    }
"""
_AS_MEASURED = """    {{
        /* The first output is read late: cubic Hermite interpolation, before the start the motion went on as it started. */
        const parameters *p = &m->p;
        const double late = {late}, dt = m->dt;
        if (m->sample == 0 || late > (double)m->sample * dt) {{
            y[0] = m->origin[0] + m->origin[1] * ((double)m->sample * dt - late);
        }} else {{
            const double place = (double)m->sample - late / dt;
            const long start = (long)fmin(fmax(floor(place), 0.0), (double)(m->sample - 1));
            const double *first = m->readings[start % {upper}_HISTORY], *last = m->readings[(start + 1) % {upper}_HISTORY];
            const double s = place - (double)start, a = first[0], b = last[0], va = first[1] * dt, vb = last[1] * dt;
            y[0] = a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb)));
        }}
    }}
"""


def c_source(exported: Exported, source: str, name: str) -> str:
    """Return the text of a C file.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    name
        What every name that others see begins with.
    """
    structure, frozen, rest, equations = (
        exported.structure,
        exported.frozen,
        exported.rest,
        equations_of(exported),
    )
    upper, names = name.upper(), _names(exported)
    names |= {symbol: f"q[{i}]" for i, symbol in enumerate(equations.constants)}
    modes = {mode: f"s[{i}]" for i, mode in enumerate(frozen.modes)}
    rates = _body("r", equations.rates, {**names, **modes})
    switches = _body("g", equations.switches, {**names, **modes})
    outputs = _body("y", equations.outputs, names)
    inputs = ["t", *(quantity.name for quantity in exported.inputs)]
    outs = [quantity.name for quantity in exported.outputs]
    delayed, late = structure.delay is not None, structure.measured_late is not None
    upper_name = {"upper": upper, "name": name}
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
        "N_STATES": len(exported.states),
        "SIZE_STATES": max(1, len(exported.states)),
        "N_MODES": len(frozen.modes),
        "SIZE_MODES": max(1, len(frozen.modes)),
        "N_INPUTS": len(exported.inputs),
        "N_OUTPUTS": len(outs),
        "N_COMPUTED": len(structure.computed_outputs),
        "MIN_STEPS": min_steps(exported),
        "STEP": repr(exported.step),
        "HISTORY": HISTORY,
        "FRICTION": -1 if frozen.friction_mode is None else frozen.friction_mode,
        "VELOCITY": structure.velocity_index or 0,
        "PARAMETER_MEMBERS": "\n".join(
            f"    double {q.name};  /* [{q.unit}] {q.description} */" for q in exported.parameters
        ),
        "HISTORY_MEMBERS": (f"    double first, pieces[{upper}_HISTORY][4];\n" if delayed else "")
        + (f"    double origin[2], readings[{upper}_HISTORY][2];\n" if late else ""),
        "SIGN_OF": _SIGN_OF if "sign_of(" in rates + switches + outputs else "",
        "RATES": rates,
        "SWITCHES": _SWITCHES.format(body=switches) if frozen.switches else "",
        "OUTPUTS": outputs,
        "LIMITS": _limits(exported),
        "REST": "" if rest is None else _rest(exported, upper),
        "REST_CALL": "" if rest is None else _REST_CALL.format(name=name),
        "N_CONSTANTS": max(1, len(equations.constants)),
        "PREPARE": _prepare(exported, equations),
        "DEFAULTS": "\n".join(
            f"    p->{q.name} = {value!r};"
            for q, value in zip(exported.parameters, exported.values, strict=True)
        ),
        "REMEMBER_FIRST": ("    m->first = u[0];\n" if delayed else "")
        + (_REMEMBER.format(**upper_name) if late else "")
        + ("    memcpy(m->origin, m->readings[0], sizeof m->origin);\n" if late else ""),
        "PIECE": (_CONSTANT_STEP.format(**upper_name) if delayed or late else "")
        + (
            _LATE_HISTORY % {"late": C.expression(structure.measured_late, names), **upper_name}
            if late
            else ""
        )
        + (_MOTION_PIECE if rest is None else _PIECES[exported.hold]),
        "STEP_BODY": _step_body(exported, upper, names),
        "REMEMBER": _REMEMBER.format(**upper_name) if late else "",
        "RATE_AT_SAMPLE": "m->u[1]" if rest is None else "0.0",
        "AS_MEASURED": _AS_MEASURED.format(late=C.expression(structure.measured_late, names), **upper_name)
        if late
        else "",
        "UPPER": upper,
        "NAME": name,
    }
    template = files("rigsight.export").joinpath("templates/model.c.txt").read_text("utf-8")
    return filled(template, fragments)


def _names(exported: Exported) -> dict[sp.Symbol, str]:
    structure = exported.structure
    return {
        INPUT: "at.value",
        INPUT_RATE: "at.rate",
        TIME: "at.time",
        **{s: f"p->{q.name}" for s, q in zip(structure.parameter_symbols, exported.parameters, strict=True)},
        **{symbol: f"x[{i}]" for i, symbol in enumerate(structure.states)},
    }


def _body(target: str, expressions: Sequence[sp.Expr], names: Mapping[sp.Symbol, str]) -> str:
    lines = C.statements([f"{target}[{i}]" for i in range(len(expressions))], expressions, names)
    text = "\n".join(lines)
    # Compilers warn of arguments that an equation happens not to read.
    known = ("p", "q", "at", "x", "s") if target != "y" else ("p", "q", "at", "x")
    marks = {"p": "p->", "q": "q[", "at": "at.", "x": "x[", "s": "s["}
    unread = [f"(void){argument};" for argument in known if marks[argument] not in text]
    if not lines:
        unread.append(f"(void){target};")
    return "\n".join(f"    {line}" for line in ([" ".join(unread)] if unread else []) + lines)


def _prepare(exported: Exported, equations: Equations) -> str:
    targets = [f"m->q[{i}]" for i in range(len(equations.constants))]
    lines = C.statements(targets, list(equations.constants.values()), _names(exported))
    head = "const parameters *p = &m->p;" if lines else "m->q[0] = 0.0;"
    return "\n".join(f"    {line}" for line in [head, *lines])


def _limits(exported: Exported) -> str:
    if not exported.limits:
        return ""
    names = _names(exported)
    lines = ["{", "    const parameters *p = &m->p;"]
    for i, limit in exported.limits.items():
        half = C.expression(limit, names)
        lines.append(f"    m->x[{i}] = fmin(fmax(m->x[{i}], -({half})), {half});")
    dependent = exported.frozen.dependent_modes
    if dependent:
        listed = ", ".join(map(str, dependent))
        lines += [
            f"    static const int dependent[] = {{{listed}}};",
            "    double values[SIZE_MODES];",
            "    int pass, k;",
            f"    for (pass = 0; pass < {len(dependent)}; pass++) {{",
            "        switches(p, m->q, at_time(c, tau), m->x, m->s, values);",
            f"        for (k = 0; k < {len(dependent)}; k++)",
            "            if (values[dependent[k]] != 0.0) m->s[dependent[k]] = values[dependent[k]] < 0.0 ? -1.0 : 1.0;",
            "    }",
        ]
    return "\n".join(f"    {line}" for line in [*lines, "}"]) + "\n"


def _rest(exported: Exported, upper: str) -> str:
    rest = exported.rest
    assert rest is not None
    names = _names(exported)
    wanted = {"m->x[0]": rest.displacement, "inertia": rest.inertia, "stiffness": rest.stiffness}
    return _REST.format(
        upper=upper,
        values="\n".join(f"    {line}" for line in C.statements(list(wanted), list(wanted.values()), names)),
        damping=rest.damping,
        silenced="".join(f"        m->p.{name} = 0.0;\n" for name in rest.silenced),
    )


def _step_body(exported: Exported, upper: str, names: Mapping[sp.Symbol, str]) -> str:
    read = "    read_signs(m, &c, 0.0);\n" if exported.hold == "zoh" else ""
    if exported.structure.delay is None:
        return _PROMPT.format(read_signs=read)
    delay = C.expression(exported.structure.delay, names)
    return _DELAYED.format(delay=delay, upper=upper, read_signs=f"    {read}" if read else "")
