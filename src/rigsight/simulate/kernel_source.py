"""Structure -> source text of one self-contained module of kernels.

The module holds two integrators of the same equations:

``simulate_one``
    One parameter set. Dormand-Prince 5(4) with error control inside each interval of the input; kinks are events: the signs
    are frozen within a step, a step that crosses a switch is cut there. Dry friction sticks by Filippov's rule. Accurate.
``simulate_lanes``
    `LANES` parameter sets side by side in vector registers, classical Runge-Kutta with a fixed number of substeps; only dry
    friction is treated as an event. Fast, accurate enough for fits.

References
----------
J. R. Dormand and P. J. Prince, J. Comput. Appl. Math. 6 (1980) 19. A. F. Filippov, *Differential Equations with Discontinuous
Righthand Sides* (Kluwer 1988).
"""

from __future__ import annotations

from importlib.resources import files

import sympy as sp

from rigsight.simulate.expressions import assignments, hoist_constants, limited
from rigsight.simulate.kinks import FrozenStructure, freeze
from rigsight.simulate.structure import INPUT, INPUT_RATE, TIME, Structure

LANES = 16
"""Parameter sets that one call of ``simulate_lanes`` advances together: two vectors of eight doubles."""

DORMAND_PRINCE_NODES = (0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0)
DORMAND_PRINCE_STAGES = (
    (),
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
DORMAND_PRINCE_ERROR = (
    71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40,
)  # fmt: skip


def kernel_source(structure: Structure) -> str:
    """Return the source of the kernel module of a structure; equal structures give equal text."""
    return _Writer(structure).module()


class _Writer:
    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.frozen: FrozenStructure = freeze(structure)
        self.n_states = max(1, len(structure.states))
        self.states = [f"x{i}" for i in range(self.n_states)]
        self.modes = [f"s{i}" for i in range(len(self.frozen.modes))]
        constants = set(structure.parameter_symbols)
        groups = [
            self._padded(self.frozen.rates),
            list(self.frozen.switches),
            list(self.frozen.outputs),
            self._padded(self._live(structure)),
            list(structure.computed_outputs),
            [equation.limit for equation in structure.equations if equation.limit is not None],
        ]
        delay = [structure.delay if structure.delay is not None else sp.Integer(0)]
        flat, self.hoisted = hoist_constants([e for g in groups for e in g] + delay, constants)
        sizes = [len(group) for group in groups]
        bounds = [sum(sizes[:i]) for i in range(len(sizes) + 1)]
        self.rates, self.switches, self.outputs, self.live_rates, self.live_outputs, limits = (
            flat[bounds[i] : bounds[i + 1]] for i in range(len(sizes))
        )
        self.delay = flat[-1]
        limited = (i for i, equation in enumerate(structure.equations) if equation.limit is not None)
        self.limits: dict[int, sp.Expr] = dict(zip(limited, limits, strict=True))
        self.constants = [symbol.name for symbol in self.hoisted]
        self.names: dict[sp.Symbol, str] = {
            INPUT: "input_value",
            INPUT_RATE: "input_rate",
            TIME: "time",
            **dict(zip(structure.states, self.states, strict=False)),
            **dict(zip(self.frozen.modes, self.modes, strict=True)),
        }

    def _padded(self, rates: tuple[sp.Expr, ...]) -> list[sp.Expr]:
        """Give a structure without states one that rests, so that the kernels have one form."""
        return list(rates) or [sp.Integer(0)]

    @staticmethod
    def _live(structure: Structure) -> tuple[sp.Expr, ...]:
        """Return the rates with what is held at an end of its range seen there.

        The state itself runs on within a substep and is put back at its end: exact as long as its rate keeps its sign.
        """
        held = {
            equation.symbol: limited(equation.symbol, equation.limit)
            for equation in structure.equations
            if equation.limit is not None
        }
        return tuple(equation.rate.xreplace(held) for equation in structure.equations)

    def module(self) -> str:
        template = files("rigsight.simulate").joinpath("kernel_template.py.txt").read_text("utf-8")
        friction = self.frozen.friction_mode
        fragments = {
            "TITLE": f"{self.structure.rig.name} with {', '.join(self.structure.effect_names) or 'no effect'}",
            "N_STATES": str(self.n_states),
            "N_MODES": str(len(self.modes)),
            "N_CONSTANTS": str(max(1, len(self.constants))),
            "N_OUTPUTS": str(len(self.outputs)),
            "LANES": str(LANES),
            "FRICTION": str(-1 if friction is None else friction),
            "VELOCITY": str(self.structure.velocity_index or 0),
            "HAS_DELAY": str(self.structure.delay is not None),
            "DEPENDENT_MODES": repr(self.frozen.dependent_modes),
            "HAS_LIMITS": str(bool(self.limits)),
            "PUT_BACK": self._put_back(),
            "PREPARE": self._prepare(),
            "DELAY": self._delay(),
            "RATES_ARGUMENTS": self._arguments([*self.states, *self.modes]),
            "RATES": self._function_body(self.rates),
            "LIVE_ARGUMENTS": self._arguments([*self.states, *self._friction_names()]),
            "LIVE_RATES": self._function_body(self._with_friction_mode(self.live_rates)),
            "SWITCHES": self._switches(),
            "OUTPUTS": self._outputs(),
            "STEP": self._step(),
            "FRICTION_ACCELERATION": self._friction_acceleration(),
            "STAGE_RATES": self._stage_rates(),
            "LANES_SUBSTEP": _indent(self._lanes_substep(), 5),
            "LANES_OUTPUTS_2": _indent(self._lanes_outputs(), 4),
            "LANES_OUTPUTS": _indent(self._lanes_outputs(), 2),
            "LANE_SCALAR_SUBSTEP": self._lane_scalar_substep(),
        }
        for key, text in fragments.items():
            template = template.replace(f"<<{key}>>", text)
        return template

    # -- shared pieces ---------------------------------------------------------------------------------------------

    def _arguments(self, names: list[str]) -> str:
        return ", ".join(["input_value", "input_rate", "time", *names, *self.constants])

    def _friction_names(self) -> list[str]:
        return ["friction_sign"] if self.frozen.friction_mode is not None else []

    def _with_friction_mode(self, expressions: list[sp.Expr]) -> list[sp.Expr]:
        """Leave the sign of a velocity that dry friction can hold as an argument of the live equations."""
        if self.frozen.friction_mode is None:
            return expressions
        velocity = self.frozen.switches[self.frozen.friction_mode]
        sign = sp.Symbol("friction_sign", real=True)
        return [e.xreplace({sp.sign(velocity): sign}) for e in expressions]

    def _function_body(self, expressions: list[sp.Expr]) -> str:
        targets = [f"r{i}" for i in range(len(expressions))]
        lines = assignments(targets, expressions, self.names, "c")
        lines.append(f"return {', '.join(targets)}{',' if len(targets) == 1 else ''}")
        return _indent(lines, 1)

    def _prepare(self) -> str:
        parameters = {s: f"p[{i}]" for i, s in enumerate(self.structure.parameter_symbols)}
        targets = [f"q[{i}]" for i in range(len(self.constants))]
        lines = assignments(targets, list(self.hoisted.values()), parameters, "c") or ["pass"]
        return _indent(lines, 1)

    def _delay(self) -> str:
        names = {symbol: f"q[{i}]" for i, symbol in enumerate(self.hoisted)}
        return _indent([*assignments(["delay"], [self.delay], names, "c"), "return delay"], 1)

    def _put_back(self) -> str:
        names = {symbol: f"q[{i}]" for i, symbol in enumerate(self.hoisted)}
        targets = [f"x[{i}]" for i in self.limits]
        held = [limited(sp.Symbol(f"x[{i}]", real=True), limit) for i, limit in self.limits.items()]
        return _indent(assignments(targets, held, names, "c") or ["pass"], 1)

    def _within_limits(self, prefix: str) -> list[str]:
        """Put states that a substep drove beyond an end of their range back on it."""
        names = dict(zip(self.hoisted, self.constants, strict=True))
        targets = [f"{prefix}{i}" for i in self.limits]
        held = [
            limited(sp.Symbol(name, real=True), limit)
            for name, limit in zip(targets, self.limits.values(), strict=True)
        ]
        return assignments(targets, held, names, "c")

    def _array_names(self) -> dict[sp.Symbol, str]:
        arrays = {s: f"x[{i}]" for i, s in enumerate(self.structure.states)}
        modes = {s: f"s[{i}]" for i, s in enumerate(self.frozen.modes)}
        constants = {s: f"q[{i}]" for i, s in enumerate(self.hoisted)}
        return {**self.names, **arrays, **modes, **constants}

    def _switches(self) -> str:
        targets = [f"g[{i}]" for i in range(len(self.switches))]
        return _indent(assignments(targets, self.switches, self._array_names(), "c") or ["pass"], 1)

    def _outputs(self) -> str:
        targets = [f"out[sample, {i}]" for i in range(len(self.live_outputs))]
        return _indent(assignments(targets, self.live_outputs, self._array_names(), "c"), 1)

    def _call(self, states: list[str], modes: list[str], stage: str) -> str:
        arguments = [f"u{stage}", f"d{stage}", f"t{stage}", *states, *modes, *self.constants]
        return f"rates({', '.join(arguments)})"

    # -- the accurate integrator ------------------------------------------------------------------------------------

    def _step(self) -> str:
        """Unrolled Dormand-Prince step over the states of this structure."""
        n = self.n_states
        lines = self._unpacked()
        for stage, (node, weights) in enumerate(
            zip(DORMAND_PRINCE_NODES, DORMAND_PRINCE_STAGES, strict=True)
        ):
            targets = [f"k{stage}_{i}" for i in range(n)]
            if stage == 0:
                lines += [f"{target} = k_first[{i}]" for i, target in enumerate(targets)]
                continue
            lines += [
                f"tau{stage} = tau + {node!r} * h",
                f"u{stage} = c0 + tau{stage} * (c1 + tau{stage} * (c2 + tau{stage} * c3))",
                f"d{stage} = c1 + tau{stage} * (2.0 * c2 + 3.0 * tau{stage} * c3)",
                f"t{stage} = start + tau{stage}",
            ]
            arguments = []
            for i in range(n):
                # The newest rate comes last and alone: all else is ready before it, so that stages wait for one product only.
                *early, newest = [(w, f"k{j}_{i}") for j, w in enumerate(weights) if w]
                terms = " + ".join(f"{w!r} * {rate}" for w, rate in early)
                known = f"(x{i} + h * ({terms}))" if early else f"x{i}"
                lines.append(f"y{stage}_{i} = {known} + (h * {newest[0]!r}) * {newest[1]}")
                arguments.append(f"y{stage}_{i}")
            call = self._call(arguments, self.modes, str(stage))
            lines.append(f"{', '.join(targets)}{',' if n == 1 else ''} = {call}")
            if self.frozen.friction_mode is not None:
                lines.append(f"k{stage}_{self.structure.velocity_index} *= moving")
        lines.append("error = 0.0")
        for i in range(n):
            terms = " + ".join(f"{w!r} * k{j}_{i}" for j, w in enumerate(DORMAND_PRINCE_ERROR) if w)
            lines += [
                f"x_new[{i}] = y6_{i}",
                f"k_last[{i}] = k6_{i}",
                f"excursion = abs(y6_{i} - origin[{i}])",
                f"relative = per_size[{i}] if excursion <= size[{i}] else 1.0 / excursion",
                f"error = max(error, abs(h * ({terms})) * relative)",
            ]
        lines.append("return error")
        return _indent(lines, 1)

    def _stage_rates(self) -> str:
        lines = self._unpacked()
        targets = ", ".join(f"k[{i}]" for i in range(self.n_states))
        call = f"rates({self._arguments([*self.states, *self.modes])})"
        lines.append(f"{targets}{',' if self.n_states == 1 else ''} = {call}")
        return _indent(lines, 1)

    def _unpacked(self) -> list[str]:
        lines = [f"{name} = q[{i}]" for i, name in enumerate(self.constants)]
        lines += [f"{name} = x[{i}]" for i, name in enumerate(self.states)]
        lines += [f"{name} = s[{i}]" for i, name in enumerate(self.modes)]
        return lines

    def _friction_acceleration(self) -> str:
        """Acceleration at rest for a given sign of the friction."""
        if self.frozen.friction_mode is None:
            return _indent(["return 0.0"], 1)
        lines = self._unpacked()
        lines.append(f"s{self.frozen.friction_mode} = sign")
        lines.append(f"x{self.structure.velocity_index} = 0.0")
        call = f"rates({self._arguments([*self.states, *self.modes])})"
        lines.append(f"return {call}[{self.structure.velocity_index}]")
        return _indent(lines, 1)

    # -- the fast integrator ----------------------------------------------------------------------------------------

    def _runge_kutta(self, target: str) -> list[str]:
        """Unrolled classical Runge-Kutta substep from x0.. to `target`0.. over h with live signs."""
        n = self.n_states
        friction = self._friction_names()
        lines: list[str] = []
        previous = ""
        for stage, (factor, point) in enumerate((("0.0", "a"), ("0.5", "b"), ("0.5", "b"), ("1.0", "c"))):
            arguments = [f"x{i}" if stage == 0 else f"x{i} + {factor} * h * {previous}_{i}" for i in range(n)]
            targets = [f"k{stage}_{i}" for i in range(n)]
            call = ", ".join([f"u{point}", f"d{point}", f"t{point}", *arguments, *friction, *self.constants])
            lines.append(f"{', '.join(targets)}{',' if n == 1 else ''} = live_rates({call})")
            if friction:
                lines.append(f"k{stage}_{self.structure.velocity_index} *= moving")
            previous = f"k{stage}"
        for i in range(n):
            lines.append(f"{target}{i} = x{i} + h / 6.0 * (k0_{i} + 2.0 * (k1_{i} + k2_{i}) + k3_{i})")
        return lines + self._within_limits(target)

    def _input_at(self, point: str, tau: str, start: str = "start") -> list[str]:
        return [
            f"u{point} = c0 + {tau} * (c1 + {tau} * (c2 + {tau} * c3))",
            f"d{point} = c1 + {tau} * (2.0 * c2 + 3.0 * {tau} * c3)",
            f"t{point} = {start} + {tau}",
        ]

    def _lanes_substep(self) -> list[str]:
        """Body of the loop over lanes: one substep, all lanes alike so that it becomes vector code."""
        lines = [f"x{i} = x[{i}, l]" for i in range(self.n_states)]
        lines += [f"{name} = q[{i}, l]" for i, name in enumerate(self.constants)]
        if self.structure.delay is not None:
            lines += [
                "h = length[l] / substeps",
                "begun = begin[l]",
                "tau_a = offset[l] + j * h",
                "tau_b = tau_a + 0.5 * h",
                "tau_c = tau_a + h",
                "row_l = row[l]",
                *[f"c{i} = c[row_l, {i}]" for i in range(4)],
                *self._input_at("a", "tau_a", "begun"),
                *self._input_at("b", "tau_b", "begun"),
                *self._input_at("c", "tau_c", "begun"),
            ]
        if self.frozen.friction_mode is None:
            lines += self._runge_kutta("y")
            lines += [f"x[{i}, l] = y{i}" for i in range(self.n_states)]
        else:
            velocity = self.structure.velocity_index
            lines += [
                f"friction_sign = 1.0 if x{velocity} > 0.0 else -1.0",
                "moving = 1.0",
                *self._runge_kutta("y"),
                f"event = (x{velocity} * y{velocity} <= 0.0)",
                "flagged[l] = 1 if event else 0",
                *[f"x[{i}, l] = x{i} if event else y{i}" for i in range(self.n_states)],
            ]
        return lines

    def _lanes_outputs(self) -> list[str]:
        arrays = {s: f"x[{i}, l]" for i, s in enumerate(self.structure.states)}
        constants = {s: f"q[{i}, l]" for i, s in enumerate(self.hoisted)}
        targets = [f"out[sample, {i}, first_lane + l]" for i in range(len(self.live_outputs))]
        names = {**self.names, **arrays, **constants}
        return assignments(targets, self.live_outputs, names, "c")

    def _lane_scalar_substep(self) -> str:
        """Runge-Kutta substep of one lane with given friction sign, for lanes in which friction reverses or holds."""
        if self.frozen.friction_mode is None:
            return _indent(["return"], 1)
        lines = [f"{name} = q[{i}, l]" for i, name in enumerate(self.constants)]
        lines += [f"x{i} = x[{i}]" for i in range(self.n_states)]
        lines += ["tau_b = tau_a + 0.5 * h", "tau_c = tau_a + h"]
        for point in "abc":
            lines += self._input_at(point, f"tau_{point}")
        lines += self._runge_kutta("y")
        lines += [f"x_new[{i}] = y{i}" for i in range(self.n_states)]
        return _indent(lines, 1)


def _indent(lines: list[str], level: int) -> str:
    return "\n".join("    " * level + line for line in lines)
