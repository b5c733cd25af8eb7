"""How does a model become one MATLAB function file, that Octave runs too?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files

import sympy as sp

from rigsight.export.description import filled, header_lines, hold_text
from rigsight.export.equations import Exported
from rigsight.export.equilibrium import NO_START, Balance
from rigsight.export.friction import friction_mode, friction_sign, held_velocity, slip_rate, slope_symbol
from rigsight.export.precomputed import constant_names, equations_of
from rigsight.export.python_function import min_steps
from rigsight.export.reserved_words import words
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

_ALL_PIECES = """function c = input_pieces(n, dt{inputs}) %#ok<INUSL>
% Inputs between samples as cubics of the time since each sample [s]: rows of c(:, :, sample), one for each input.
c = zeros({count}, 4, n);
{lines}
end{functions}"""
_PIECE = "c({i}, :, :) = reshape({call}.', 1, 4, []);"
_CALLS = {"zoh": "steps_of({name})", "foh": "lines_of({name}, dt)"}
_CUBIC = "cubics_of({value}, {rate}, dt)"
_FUNCTIONS = {
    "zoh": """

function c = steps_of(u)
u = u(:);
c = [u, zeros(numel(u), 3)];
end""",
    "foh": """

function c = lines_of(u, dt)
u = u(:);
c = [u, [diff(u) / dt; 0], zeros(numel(u), 2)];
end""",
    "cubic": """

function c = cubics_of(u, v, dt)
u = u(:);
v = v(:);
rise = diff(u);
c2 = (3 * rise - (2 * v(1:end - 1) + v(2:end)) * dt) / dt^2;
c3 = ((v(1:end - 1) + v(2:end)) * dt - 2 * rise) / dt^3;
c = [u, v, [c2; 0], [c3; 0]];
end""",
}
_REST = """function x = rest(p, first)
% The static equilibrium at the first input, reached slowly from rest without memory.
x = zeros({n_states}, 1);
{values}
if stiffness <= 0
  return
end
p.{damping} = max(p.{damping}, 2 * sqrt(stiffness * inertia));
{silenced}span = 40 * pi * sqrt(inertia / stiffness);
[x, found] = settled(p, x, 0, span);
if found && first ~= 0
  x = settled(p, x, first, span);
end
end

function [x, found] = settled(p, x, last, span)
% A ramp of the input from zero, and waits until nothing moves.
piece = [0, last / span, 0, 0];
duration = span;
found = true;
for wait = 0:6
  m = read_signs(motion_from(p, x), piece, 0, 0);
  if last == 0 && ~any(slopes(m, piece, 0, 0, x))
    return
  end
  m = advance(m, piece, 0, 0, duration);
  if ~all(isfinite(m.x))
    found = false;
    return
  end
  moved = abs(m.x - x) - 1e-9 * abs(m.x);
  moved({velocity}) = 0;
  x = m.x;
  if all(moved <= 0)
    break
  end
  piece = [last, 0, 0, 0];
  duration = span * 2^wait;
end
x({velocity}) = 0;
end"""
_NO_REST = """function x = rest(p, first) %#ok<INUSD>
x = zeros({n_states}, 1);
end"""
_FRICTION = """function [forward, backward] = sliding(m, piece, begin, tau, x)
% Rates with dry friction that resists sliding forward, and backward.
[value, rate, curvature, time] = at(piece, begin, tau);
s = m.s;
s({friction}) = 1;
forward = rates(m.p, value, rate, curvature, time, x, s);
s({friction}) = -1;
backward = rates(m.p, value, rate, curvature, time, x, s);
end

function slip = slip_rate(m, piece, begin, tau, x, slopes) %#ok<INUSD>
% How fast the velocity changes that dry friction can hold.
p = m.p;
[input_value, input_rate, input_curvature, time] = at(piece, begin, tau); %#ok<ASGLU>
{slip_rate}
end

function [forward, backward] = leaves(m, piece, begin, tau, x)
% How fast a joint that dry friction holds would begin to slide forward, and backward.
[one, other] = sliding(m, piece, begin, tau, x);
forward = slip_rate(m, piece, begin, tau, x, one);
backward = slip_rate(m, piece, begin, tau, x, other);
end

function m = hold_or_leave(m, piece, begin, tau)
% Decide at rest whether dry friction holds the joint or which way it leaves.
[forward, backward] = leaves(m, piece, begin, tau, m.x);
m.moving = forward > 0 || backward < 0;
m.s({friction}) = 1;
if backward < 0 && ~(forward > 0)
  m.s({friction}) = -1;
end
end

function m = stop_sliding(m, piece, begin, tau) %#ok<INUSD>
% Take from the velocities what the joint still slides.
{stop}
end

"""
_STOP_ONE = "m.x({velocity}) = 0;"
_STOP = """[one, other] = sliding(m, piece, begin, tau, m.x);
stroke = one - other;
[value, rate, curvature, time] = at(piece, begin, tau);
g = switches(m.p, value, rate, curvature, time, m.x, m.s);
share = g({friction}) / slip_rate(m, piece, begin, tau, m.x, stroke);
m.x = m.x - share * stroke;"""
_FRICTION_SIGN = """friction_sign = m.s({friction});
if ~m.moving
  [forward, backward] = leaves(m, piece, begin, tau, m.x);
  friction_sign = min(max((backward + forward) / (backward - forward), -1), 1);
end
"""
_KEEP_HELD = """  if ~m.moving
    found({friction}) = m.s({friction});
  end
"""
_HOLD_AT_REST = """if ~m.moving || g({friction}) == 0
  m = hold_or_leave(m, piece, begin, tau);
end
"""
_HELD_SLOPE = """if ~m.moving
  [one, other] = sliding(m, piece, begin, tau, x);
  a = slip_rate(m, piece, begin, tau, x, one);
  b = slip_rate(m, piece, begin, tau, x, other);
  k = (other * a - one * b) / (a - b);
end
"""
_HELD_DISTANCES = """if ~m.moving
  g({friction}) = 1;
  [forward, backward] = leaves(m, piece, begin, tau, x);
  g(end - 1) = -forward;
  g(end) = backward;
end
"""
_FRICTION_CROSSED = """if g(end - 1) < 0 || g(end) < 0
  m.moving = true;
  m.s({friction}) = 1 - 2 * (g(end - 1) >= 0);
elseif g({friction}) < 0
  m = stop_sliding(m, piece, begin, tau);
  m = hold_or_leave(m, piece, begin, tau);
end
"""
_DEPENDENT = """[value, rate, curvature, time] = at(piece, begin, tau);
for pass = 1:{count}
  values = switches(m.p, value, rate, curvature, time, m.x, m.s);
  for i = [{listed}]
    if values(i) ~= 0
      m.s(i) = sign(values(i));
    end
  end
end
"""
_AS_MEASURED = """if n > 1
  % The first output is read late: cubic Hermite interpolation, before the start the motion went on as it started.
  place = (0:n - 1)' - ({late}) / dt;
  start = min(max(floor(place), 0), n - 2);
  s = place - start;
  value = computed(:, 1);
  rate = computed(:, end) * dt;
  a = value(start + 1);
  b = value(start + 2);
  va = rate(start + 1);
  vb = rate(start + 2);
  inside = a + s .* (va + s .* (3 * (b - a) - 2 * va - vb + s .* (2 * (a - b) + va + vb)));
  early = s < 0;
  inside(early) = value(1) + rate(1) * place(early);
  outputs(:, 1) = inside;
end
"""


def matlab_function(exported: Exported, source: str, name: str) -> str:
    """Return the text of a function file."""
    structure, frozen, equations = exported.structure, exported.frozen, equations_of(exported)
    constants = {symbol: f"p.{name}" for symbol, name in constant_names(equations).items()}
    names = _names(exported) | constants
    prepare = MATLAB.statements(list(constants.values()), list(equations.constants.values()), names)
    modes = {mode: f"s({i + 1})" for i, mode in enumerate(frozen.modes)}
    inputs = [quantity.name for quantity in exported.inputs]
    head = header_lines(exported, source, with_parameters=False)
    late = structure.first_shown_late
    fragments = {
        "HEADER": "\n".join(f"% {line}".rstrip() for line in head),
        "TITLE": f"Simulation of {exported.title}",
        "HOLD_TEXT": hold_text(exported),
        "ARGUMENTS": ", ".join(["t", *inputs]),
        "MORE_INPUTS": "".join(f", {name}" for name in inputs),
        "N_ARGUMENTS": 1 + len(inputs),
        "OUTPUT_TEXT": ", ".join(output.name for output in exported.outputs),
        "STATE_TEXT": ", ".join(state.name for state in exported.states) or "(none)",
        "DELAY": "0" if structure.delay is None else MATLAB.expression(structure.delay, names),
        "READ_SIGNS": "  m = read_signs(m, piece, start + split, 0);\n" if exported.hold == "zoh" else "",
        "AS_MEASURED": "" if late is None else _AS_MEASURED.format(late=MATLAB.expression(late, names)),
        "PARAMETERS": "\n".join(
            f"p.{q.name} = {value!r};   % [{q.unit}] {q.description}"
            for q, value in zip(exported.parameters, exported.values, strict=True)
        ),
        "PREPARE": "\n".join(prepare),
        "STEP": repr(exported.step),
        "MIN_STEPS": min_steps(exported),
        "RATES": _body("r", equations.rates, {**names, **modes}, equations.steps),
        "SWITCHES": _body("g", equations.switches, {**names, **modes}),
        "OUTPUTS": _body(
            "y",
            equations.outputs,
            {**names, friction_sign(exported): "friction_sign"},
            equations.shown_steps,
        ),
        "PIECES": _pieces(exported, inputs),
        "WITHOUT_MODES": "" if frozen.modes else "  m.x = x_new;\n  return\n",
        **_friction(exported),
        "LIMITS": _limits(exported),
        "REST": _rest(exported),
        "N_STATES": len(exported.states),
        "N_MODES": len(frozen.modes),
        "N_OUTPUTS": len(exported.outputs),
        "N_COMPUTED": len(structure.computed_outputs),
        "NAME": name,
    }
    template = files("rigsight.export").joinpath("templates/model.m.txt").read_text("utf-8")
    return filled(template, fragments)


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
    mode, velocity = friction_mode(exported), held_velocity(exported)
    texts = {
        "FRICTION_SIGN": _FRICTION_SIGN,
        "KEEP_HELD": _KEEP_HELD,
        "HOLD_AT_REST": _HOLD_AT_REST,
        "HELD_SLOPE": _HELD_SLOPE,
        "HELD_DISTANCES": _HELD_DISTANCES,
        "FRICTION_CROSSED": _FRICTION_CROSSED,
        "FRICTION": _FRICTION,
    }
    if mode is None:
        return dict.fromkeys(texts, "")
    slopes = {slope_symbol(i): f"slopes({i + 1})" for i in range(len(exported.states))}
    own = {
        "friction": mode + 1,
        "slip_rate": "\n".join(
            MATLAB.statements(["slip"], [slip_rate(exported)], {**_names(exported), **slopes})
        ),
        "stop": (_STOP if velocity is None else _STOP_ONE).format(
            friction=mode + 1, velocity=(velocity or 0) + 1
        ),
    }
    return {key: text.format(**own) for key, text in texts.items()}


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
        call = (
            _CALLS[exported.hold].format(name=source.value.name)
            if source.rate is None
            else _CUBIC.format(value=source.value.name, rate=source.rate.name)
        )
        lines.append(_PIECE.format(i=i + 1, call=call))
        functions[kind] = _FUNCTIONS[kind]
    more = "".join(f", {name}" for name in inputs)
    return _ALL_PIECES.format(
        inputs=more, count=len(lines), lines="\n".join(lines), functions="".join(functions.values())
    )


def _limits(exported: Exported) -> str:
    names = {
        symbol: name.replace("p.", "m.p.").replace("x(", "m.x(") for symbol, name in _names(exported).items()
    }
    text = ""
    for i, limit in exported.limits.items():
        half = MATLAB.expression(limit, names)
        text += f"m.x({i + 1}) = min(max(m.x({i + 1}), -({half})), {half});\n"
    dependent = exported.frozen.dependent_modes
    if exported.limits and dependent:
        text += _DEPENDENT.format(count=len(dependent), listed=", ".join(str(i + 1) for i in dependent))
    return text


def _rest(exported: Exported) -> str:
    rest = exported.rest
    if rest is None:
        return _NO_REST.format(n_states=len(exported.states))
    if isinstance(rest, Balance):
        return _balance(exported, rest)
    names = _names(exported)
    wanted = {"x(1)": rest.displacement, "inertia": rest.inertia, "stiffness": rest.stiffness}
    return _REST.format(
        n_states=len(exported.states),
        values="\n".join(MATLAB.statements(list(wanted), list(wanted.values()), names)),
        damping=rest.damping,
        silenced="".join(f"p.{name} = 0;\n" for name in rest.silenced),
        velocity=1 + (exported.structure.velocity_index or 0),
    )


def _balance(exported: Exported, rest: Balance) -> str:
    names, n = _names(exported), len(rest.unknown)
    targets = [f"r({i + 1})" for i in range(n)]
    targets += [f"s({i + 1}, {k + 1})" for i in range(n) for k in range(n)]
    expressions = [*rest.residuals, *(slope for row in rest.slopes for slope in row)]
    starts = MATLAB.statements([f"x({i + 1})" for i in rest.start], list(rest.start.values()), names)
    text = files("rigsight.export").joinpath("templates/equilibrium.m.txt").read_text("utf-8")
    return filled(
        text,
        {
            "UNBALANCED": "\n".join(MATLAB.statements(targets, expressions, names)),
            "START": "\n".join(starts),
            "UNKNOWN": ", ".join(str(i + 1) for i in rest.unknown),
            "N_UNKNOWN": n,
            "BALANCED": repr(BALANCED),
            "UNDER_INPUT": f"  error('{NO_START}');" if rest.remembers else "  x = balanced(p, first, x);",
            "N_STATES": len(exported.states),
        },
    )
