"""How does a model become one MATLAB function file, that Octave runs too?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files

import sympy as sp

from rigsight.export.description import filled, header_lines, hold_text
from rigsight.export.equations import Exported
from rigsight.export.precomputed import equations_of
from rigsight.export.python_function import min_steps
from rigsight.simulate.printing.matlab import MATLAB
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME

_DRIVE_PIECES = """function c = input_pieces(dt, {inputs})
% Input between samples as cubics of the time since each sample [s], one row for each.
u = {inputs}(:);
c = [u, [{slopes}], zeros(numel(u), 2)];
end"""
_SLOPES = {"zoh": "zeros(size(u))", "foh": "diff(u) / dt; 0"}
_MOTION_PIECES = """function c = input_pieces(dt, {inputs})
% Motion between samples as cubics of the time since each sample [s], one row for each.
u = {value}(:);
v = {rate}(:);
rise = diff(u);
c2 = (3 * rise - (2 * v(1:end - 1) + v(2:end)) * dt) / dt^2;
c3 = ((v(1:end - 1) + v(2:end)) * dt - 2 * rise) / dt^3;
c = [u, v, [c2; 0], [c3; 0]];
end"""
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
_FRICTION = """function a = friction_acceleration(m, piece, begin, tau, x, direction)
[value, rate, time] = at(piece, begin, tau);
s = m.s;
s({friction}) = direction;
x({velocity}) = 0;
k = rates(m.p, value, rate, time, x, s);
a = k({velocity});
end

function m = hold_or_leave(m, piece, begin, tau)
% Decide at zero velocity whether dry friction holds the mass or which way it leaves.
forward = friction_acceleration(m, piece, begin, tau, m.x, 1);
backward = friction_acceleration(m, piece, begin, tau, m.x, -1);
m.moving = forward > 0 || backward < 0;
m.s({friction}) = 1;
if backward < 0 && ~(forward > 0)
  m.s({friction}) = -1;
end
end

"""
_HELD_DISTANCES = """if ~m.moving
  g({friction}) = 1;
  g(end - 1) = -friction_acceleration(m, piece, begin, tau, x, 1);
  g(end) = friction_acceleration(m, piece, begin, tau, x, -1);
end
"""
_FRICTION_CROSSED = """if g(end - 1) < 0 || g(end) < 0
  m.moving = true;
  m.s({friction}) = 1 - 2 * (g(end - 1) >= 0);
elseif g({friction}) < 0
  m.x({velocity}) = 0;
  m = hold_or_leave(m, piece, begin, tau);
end
"""
_DEPENDENT = """[value, rate, time] = at(piece, begin, tau);
for pass = 1:{count}
  values = switches(m.p, value, rate, time, m.x, m.s);
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
    """Return the text of a function file.

    Parameters
    ----------
    exported
        The model.
    source
        The file it comes from.
    name
        Name of the function; its file must have the same.
    """
    structure, frozen, equations = exported.structure, exported.frozen, equations_of(exported)
    names = _names(exported) | {symbol: f"p.{symbol.name}" for symbol in equations.constants}
    modes = {mode: f"s({i + 1})" for i, mode in enumerate(frozen.modes)}
    inputs = [quantity.name for quantity in exported.inputs]
    velocity = 1 + (structure.velocity_index or 0)
    sticks = frozen.friction_mode is not None
    friction = {"friction": 1 + (frozen.friction_mode or 0), "velocity": velocity}
    head = header_lines(exported, source, with_parameters=False)
    late = structure.measured_late
    fragments = {
        "HEADER": "\n".join(f"% {line}".rstrip() for line in head),
        "TITLE": f"Simulation of {exported.title}",
        "HOLD_TEXT": hold_text(exported),
        "INPUTS": ", ".join(inputs),
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
        "PREPARE": "\n".join(
            MATLAB.statements(
                [f"p.{symbol.name}" for symbol in equations.constants],
                list(equations.constants.values()),
                names,
            )
        ),
        "STEP": repr(exported.step),
        "MIN_STEPS": min_steps(exported),
        "RATES": _body("r", equations.rates, {**names, **modes}),
        "SWITCHES": _body("g", equations.switches, {**names, **modes}),
        "OUTPUTS": _body("y", equations.outputs, names),
        "PIECES": _pieces(exported, inputs),
        "HOLD_AT_REST": f"if m.x({velocity}) == 0\n  m = hold_or_leave(m, piece, begin, tau);\nend\n"
        if sticks
        else "",
        "HELD_SLOPE": f"if ~m.moving\n  k({velocity}) = 0;\nend\n" if sticks else "",
        "HELD_DISTANCES": _HELD_DISTANCES.format(**friction) if sticks else "",
        "WITHOUT_MODES": "" if frozen.modes else "  m.x = x_new;\n  return\n",
        "FRICTION_CROSSED": _FRICTION_CROSSED.format(**friction) if sticks else "",
        "FRICTION": _FRICTION.format(**friction) if sticks else "",
        "LIMITS": _limits(exported),
        "REST": _rest(exported, velocity),
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
    return {
        INPUT: "input_value",
        INPUT_RATE: "input_rate",
        TIME: "time",
        **{s: f"p.{q.name}" for s, q in zip(structure.parameter_symbols, exported.parameters, strict=True)},
        **{symbol: f"x({i + 1})" for i, symbol in enumerate(structure.states)},
    }


def _body(target: str, expressions: Sequence[sp.Expr], names: Mapping[sp.Symbol, str]) -> str:
    targets = [f"{target}({i + 1})" for i in range(len(expressions))]
    return "\n".join(MATLAB.statements(targets, expressions, names))


def _pieces(exported: Exported, inputs: list[str]) -> str:
    joined = ", ".join(inputs)
    if exported.rest is None:
        return _MOTION_PIECES.format(inputs=joined, value=inputs[0], rate=inputs[1])
    return _DRIVE_PIECES.format(inputs=joined, slopes=_SLOPES[exported.hold])


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


def _rest(exported: Exported, velocity: int) -> str:
    rest = exported.rest
    if rest is None:
        return _NO_REST.format(n_states=len(exported.states))
    names = _names(exported)
    wanted = {"x(1)": rest.displacement, "inertia": rest.inertia, "stiffness": rest.stiffness}
    return _REST.format(
        n_states=len(exported.states),
        values="\n".join(MATLAB.statements(list(wanted), list(wanted.values()), names)),
        damping=rest.damping,
        silenced="".join(f"p.{name} = 0;\n" for name in rest.silenced),
        velocity=velocity,
    )
