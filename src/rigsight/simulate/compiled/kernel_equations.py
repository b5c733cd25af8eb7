"""The equations of a structure as C functions of numbered states, modes and constants: for one set, and for sets side by side."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

import sympy as sp

from rigsight.effects.symbols import rate_along
from rigsight.libraries.templates import filled, template
from rigsight.simulate.equations.kinks import FrozenStructure, freeze
from rigsight.simulate.equations.straight_line import gathered, hoist_constants
from rigsight.simulate.equations.structure import TIME, LateInput, Structure, input_rates, input_symbols
from rigsight.simulate.printing.language import FUNCTIONS, elements, function_body, limited, real


class KernelEquations:
    """The equations of a structure as C functions of numbered states, modes and constants."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.frozen: FrozenStructure = freeze(structure)
        # Late inputs are read as further inputs, so that no history has to be kept of them.
        self.arriving = structure.late_inputs or ()
        self._remembered = structure.histories if structure.late_inputs is None else ()
        self._friction_signs = self.frozen.friction_signs(structure)
        fixed, speeds = set(structure.parameter_symbols), self.frozen.speeds(structure)
        groups: dict[str, Sequence[sp.Expr]] = {
            "steps": list(self.frozen.steps.values()),
            "live_steps": [self._live(step) for step in structure.remembering_steps.values()],
            "rates": [gathered(rate, fixed, set(self.frozen.modes)) for rate in self.frozen.rates],
            "switches": self.frozen.switches,
            "switch_slopes": [self._slope(switch) for switch in self.frozen.switches],
            "outputs": [
                output.xreplace(self._friction_signs if self.friction_is_shown else {})
                for output in structure.computed_outputs
            ],
            "live_rates": [gathered(self._live(e.rate), fixed) for e in structure.remembering_equations],
            "speeds": speeds,
            "speed_slopes": [self._slope(speed) for speed in speeds],
            "limits": [e.limit for e in structure.remembering_equations if e.limit is not None],
            "signals": [history.signal for history in self._remembered],
            "delays": [history.delay for history in self._remembered],
            "arrivals": self._delays,
        }
        flat, hoisted = hoist_constants(
            [expression.xreplace(self._as_arriving) for group in groups.values() for expression in group],
            set(structure.parameter_symbols),
        )
        self.constants: dict[sp.Symbol, sp.Expr] = hoisted
        remaining = iter(flat)
        self._groups = {name: [next(remaining) for _ in group] for name, group in groups.items()}
        # In terms of states, inputs and constants, as all groups are.
        self.outputs, self.delays = self._groups["outputs"], self._groups["arrivals"]
        self._steps = dict(zip(self.frozen.steps, self._groups["steps"], strict=True))
        limited_states = (
            i for i, equation in enumerate(structure.remembering_equations) if equation.limit is not None
        )
        self.limits = dict(zip(limited_states, self._groups["limits"], strict=True))

    def text(self, parameters: str, parameter_names: Sequence[str]) -> str:
        """Return the part of a C file that contains the equations."""
        structure, frictions = self.structure, self.frozen.frictions
        single, dependent = self.frozen.single_friction, self.frozen.dependent_modes
        n_states, n_modes = len(structure.states), len(self.frozen.modes)
        names = self._names
        prepare = dict(zip(structure.parameter_symbols, parameter_names, strict=True))
        fragments = {
            "N_STATES": n_states,
            "SIZE_STATES": max(1, n_states),
            "N_MODES": n_modes,
            "SIZE_MODES": max(1, n_modes),
            "SIZE_COLUMNS": max(1, structure.n_inputs),
            "N_INPUTS": len(self._read_inputs),
            "SIZE_INPUTS": max(1, len(self._read_inputs)),
            "SIZE_CONSTANTS": max(1, len(self.constants)),
            "N_COMPUTED": len(structure.computed_outputs),
            "N_DEGREES": len(structure.tree.motion.coordinates),
            "N_FRICTIONS": len(frictions),
            "SIZE_FRICTIONS": max(1, len(frictions)),
            "FRICTION_MODES": _array(own.mode for own in frictions),
            "FRICTION_VELOCITIES": _array(
                (-1 if f.velocity is None else f.velocity for f in frictions), "-1"
            ),
            "FRICTION_IS_SHOWN": int(self.friction_is_shown),
            "VELOCITY": (structure.velocity_index or 0) if single is None else single.velocity,
            "N_ARRIVING": len(self._delays),
            "ARRIVE": self._body("q by", "by", self.delays),
            "N_LATE": len(self._remembered),
            "READS_LATE_RATE": int(
                any(slope.free_symbols & set(self._late_rates) for slope in self._groups["switch_slopes"])
            ),
            "SIGNALS": self._body("now x q w", "w", self._groups["signals"]),
            "DELAYS": self._body("q by", "by", self._groups["delays"]),
            "HAS_LIMITS": int(bool(self.limits) and n_modes > 0),
            "N_DEPENDENT": len(dependent),
            "DEPENDENT_MODES": _array(dependent),
            "PARAMETERS": parameters,
            "PREPARE": function_body(
                ("p", "q"), elements("q", len(self.constants)), list(self.constants.values()), prepare
            ),
            "RATES": self._body("now x s q r", "r", self._groups["rates"]),
            "SWITCHES": function_body(
                ["now", "x", "k", "s", "q", "g", "d"],
                [*elements("g", n_modes), *elements("d", n_modes)],
                [*self._groups["switches"], *self._groups["switch_slopes"]],
                names,
            ),
            "PUT_BACK": function_body(("x", "q"), *self._put_back(self.limits), names)
            if self.limits and n_modes > 0
            else "",
            "OUTPUTS": self._body("now x s q y", "y", self._groups["outputs"]),
        }
        texts = {key: str(value) for key, value in fragments.items()}
        bodies = "\n".join(texts.values())
        called = [text for name, text in FUNCTIONS.items() if f"{name}(" in bodies]
        return filled(template("simulate", "equations.c.txt"), {"FUNCTIONS": "\n".join(called), **texts})

    def input_fragments(self) -> dict[str, str]:
        """Return which recorded input each input of the equations is, and its delay, by key in the template."""
        return {
            "INPUT_COLUMNS": ", ".join(str(column) for column, _ in self._read_inputs),
            "INPUT_DELAYS": ", ".join(str(delay) for _, delay in self._read_inputs),
        }

    def lane_fragments(self) -> dict[str, str]:
        """Return the equations for parameter sets side by side, by their key in the template."""
        structure, names, rates = self.structure, self.lane_names, self.lane_rates
        followers = {i: self.limits[i] for i in self._followed}
        gained = {i: real(f"x[{i}]") + real(now) - real(was) for i, (was, now) in self._followed.items()}
        kept = [limited(gained[i], limit) for i, limit in followers.items()]
        # Symbols without a name are C code already.
        written = {s: s.name for e in kept for s in e.free_symbols if s not in names}
        others = {i: limit for i, limit in self.limits.items() if i not in followers}
        frictions, several = self.frozen.frictions, self.has_several_frictions
        slopes = self._groups["speed_slopes"]
        curvatures = {input_symbols(i)[2] for i in range(structure.n_inputs)}
        read = set().union(
            *(e.free_symbols for e in (*rates, *self.outputs, *slopes, *self.lane_steps.values()))
        )
        integrated = [i for i in range(len(structure.states)) if i not in self._followed]
        return {
            "SINGLE_FRICTION": str(0 if frictions and not several else -1),
            "SEVERAL_FRICTIONS": str(len(frictions) if several else 0),
            "HAS_CURVATURE": str(int(bool(curvatures & read))),
            "LANE_SPEEDS": self._body("now x q", "g", self._groups["speeds"], lanes=True),
            "LANE_SPEED_SLOPES": self._body("now x k q", "d", slopes, lanes=True),
            "N_INTEGRATED": str(len(integrated)),
            "INTEGRATED": _array(integrated),
            "LANE_RATES": self._body("now x q r", "r", rates, lanes=True),
            "LANE_OUTPUTS": self._body("now x q y", "y", self.outputs, lanes=True),
            "LANE_FOLLOWERS": function_body(
                (), [f"y[{i}]" for i in followers], kept, names | written, lanes=True
            ),
            "LANE_PUT_BACK": function_body((), *self._put_back(others), names, lanes=True),
        }

    def _body(
        self, arguments: str, array: str, expressions: Sequence[sp.Expr], *, lanes: bool = False
    ) -> str:
        """Return the body of a function that writes expressions to an array, after the steps that they need."""
        names, steps = (self.lane_names, self.lane_steps) if lanes else (self._names, self._steps)
        targets = elements(array, len(expressions))
        return function_body(arguments.split(), targets, expressions, names, lanes=lanes, steps=steps)

    @cached_property
    def lane_names(self) -> dict[sp.Symbol, str]:
        """Name in C of each symbol, for sets side by side."""
        form = "friction_sign[{}]" if self.has_several_frictions else "friction_sign"
        count = len(self.frozen.frictions)
        return self._names | {FrozenStructure.friction_sign(i): form.format(i) for i in range(count)}

    @cached_property
    def _delays(self) -> list[sp.Expr]:
        """Each delay of inputs once."""
        return list(dict.fromkeys(late.delay for late in self.arriving))

    @property
    def _read_inputs(self) -> list[tuple[int, int]]:
        """Column and delay of each input that the equations read; the delay is -1 for an input that is not late."""
        late = [(own.index, self.delay_of(own)) for own in self.arriving]
        on_time = [(column, -1) for column in range(self.structure.n_inputs)]
        # The only input of a rig is not read without its delay.
        return [*on_time, *late] if self.structure.histories else late or on_time

    def delay_of(self, late: LateInput) -> int:
        """Return the number of the delay of an input."""
        return self._delays.index(late.delay)

    @cached_property
    def _as_arriving(self) -> dict[sp.Symbol, sp.Expr]:
        """Each delayed signal of inputs, and its rate, in terms of the inputs that arrive late."""
        found: dict[sp.Symbol, sp.Expr] = {}
        if self._remembered or not self.arriving:
            return found
        for history, rate in zip(self.structure.histories, self._late_rates, strict=True):
            own = {
                input_symbols(late.index)[0]: late for late in self.arriving if late.delay == history.delay
            }
            late_values = {symbol: late.value for symbol, late in own.items()}
            found[history.symbol] = history.signal.xreplace(late_values)
            rates = {symbol: late.rate for symbol, late in own.items()}
            found[rate] = rate_along(history.signal, rates).xreplace(late_values)
        return found

    @cached_property
    def lane_rates(self) -> list[sp.Expr]:
        """The rates for sets side by side."""
        rates = self._groups["live_rates"]
        return [sp.Integer(0) if i in self._followed else rate for i, rate in enumerate(rates)]

    @cached_property
    def lane_steps(self) -> dict[sp.Symbol, sp.Expr]:
        """Intermediate values computed before rates and outputs for sets side by side, as `Structure.steps`."""
        return dict(zip(self.frozen.steps, self._groups["live_steps"], strict=True))

    def _put_back(self, limits: Mapping[int, sp.Expr]) -> tuple[list[str], list[sp.Expr]]:
        states = self.structure.states
        return [f"x[{i}]" for i in limits], [limited(states[i], limit) for i, limit in limits.items()]

    @cached_property
    def _names(self) -> dict[sp.Symbol, str]:
        numbered = {
            "x": self.structure.states,
            "k": self._rate_symbols,
            "s": self.frozen.modes,
            "q": tuple(self.constants),
        }
        inputs = {
            symbol: f"now->{array}[{i}]"
            for i in range(self.structure.n_inputs)
            for symbol, array in zip(input_symbols(i), ("u", "du", "ddu"), strict=True)
        }
        signs = {
            FrozenStructure.friction_sign(i): f"s[{f.mode}]" for i, f in enumerate(self.frozen.frictions)
        }
        names = inputs | {TIME: "now->time"} | self._late_names | signs
        return names | {s: f"{array}[{i}]" for array, own in numbered.items() for i, s in enumerate(own)}

    @property
    def _late_names(self) -> dict[sp.Symbol, str]:
        """Name in C of each delayed signal and of its rate."""
        if self._remembered:
            late = zip(self._remembered, self._late_rates, strict=True)
            return {
                symbol: name
                for i, (history, rate) in enumerate(late)
                for symbol, name in ((history.symbol, f"now->late[{i}]"), (rate, f"now->late_rate[{i}]"))
            }
        first = self.structure.n_inputs if self.structure.histories else 0
        return {
            symbol: name
            for i, late in enumerate(self.arriving, first)
            for symbol, name in ((late.value, f"now->u[{i}]"), (late.rate, f"now->du[{i}]"))
        }

    @cached_property
    def _rate_symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(sp.Symbol(f"rate {i}", real=True) for i in range(len(self.structure.states)))

    @cached_property
    def _late_rates(self) -> tuple[sp.Symbol, ...]:
        return tuple(sp.Symbol(f"late_rate_{i}", real=True) for i in range(len(self.structure.histories)))

    @property
    def reads_late(self) -> str:
        """A C array with, for each delayed signal, the flags of the delayed signals that it depends on."""
        read = [
            [int(other.symbol in own.signal.free_symbols) for other in self._remembered]
            for own in self._remembered
        ]
        return ", ".join(f"{{{_array(row)}}}" for row in read)

    def _slope(self, expression: sp.Expr) -> sp.Expr:
        """Return the total derivative of an expression with respect to time, between events."""
        along = {**dict(zip(self.structure.states, self._rate_symbols, strict=True)), TIME: sp.Integer(1)}
        along |= input_rates(self.structure.n_inputs)
        along |= {h.symbol: rate for h, rate in zip(self.structure.histories, self._late_rates, strict=True)}
        return rate_along(expression, along)

    @property
    def friction_is_shown(self) -> bool:
        """Whether an output contains the sign of a velocity that dry friction can hold, and so shows the holding force."""
        signs = {self.frozen.modes[own.mode] for own in self.frozen.frictions}
        return any(output.free_symbols & signs for output in self.frozen.outputs)

    @property
    def has_several_frictions(self) -> bool:
        """Whether dry friction is more than a single one that holds one velocity and affects no other velocity or output."""
        frozen = self.frozen
        return bool(frozen.frictions) and (frozen.single_friction is None or self.friction_is_shown)

    def _live(self, expression: sp.Expr) -> sp.Expr:
        """Return a part of the equations with the current signs, for steps that are not divided at events."""
        # A state with a limited range enters the equations with its limited value. The state itself is integrated without the
        # limit within a substep and limited at its end, which is exact as long as its rate keeps its sign. The sign of a velocity
        # that dry friction can hold is an argument.
        equations = self.structure.remembering_equations
        held = {e.symbol: limited(e.symbol, e.limit) for e in equations if e.limit is not None}
        return expression.xreplace(self._friction_signs | held)

    @cached_property
    def _followed(self) -> dict[int, tuple[str, str]]:
        """States with a limited range that follow a motion, with the names in C of that motion before and after a substep."""
        motions: dict[sp.Expr, tuple[str, str]] = {
            input_symbols(i)[1]: (f"from->u[{i}]", f"now->u[{i}]") for i in range(self.structure.n_inputs)
        }
        for i, equation in enumerate(self.structure.remembering_equations):
            if equation.limit is None:
                motions.setdefault(equation.rate, (f"x[{i}]", f"y[{i}]"))
        return {
            i: motions[equation.rate]
            for i, equation in enumerate(self.structure.remembering_equations)
            if equation.limit is not None and equation.rate in motions
        }


def _array(numbers: Iterable[int], without: str = "0") -> str:
    """Return the elements of an array in C, which has one at least."""
    return ", ".join(map(str, numbers)) or without
