"""What is shown is what is simulated: every shown equation, evaluated, against the simulation at random instants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import combinations

import numpy as np
import pytest
import sympy as sp

from rigsight.effects import CATALOGUE, effect_named
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose
from rigsight.simulate.equation_tree import late
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.kernel_cache import kernel_of
from rigsight.simulate.printing.names import output_symbol, rate_symbol
from rigsight.simulate.printing.shown import ShownEquation, shown_equations
from rigsight.simulate.structure import INPUT, TIME

_TOGETHER = (
    ("backlash", "bouc_wen_hysteresis"),
    ("free_play", "backlash", "iwan_hysteresis"),
    ("bouc_wen_hysteresis", "iwan_hysteresis"),
    ("actuator_lag", "input_saturation"),
    ("input_dead_zone", "input_delay", "input_saturation", "actuator_lag"),
    ("sensor_lag", "sensor_delay"),
    ("input_delay", "sensor_delay"),
    ("coulomb_friction", "stribeck_friction", "end_stop"),
    ("creep_saturation", "conicity_variation"),
)
ONE_MOTION = [name for name, rig in RIGS.items() if rig.has_one_motion]
CASES = [
    (rig, names)
    for rig in ONE_MOTION
    for names in ((), *((effect.name,) for effect in CATALOGUE), *_TOGETHER)
    if all(RIGS[rig].offers(effect_named(name)) for name in names)
]
_INSTANTS = 12
_MOMENT = 1e-6
"""Step of the compiled kernel [s]; the rates here change by about their size in a second."""


class Reader:
    """Somebody who has the page, numbers and a pocket calculator: knows the shown equations and nothing of the tree."""

    def __init__(self, structure: Structure, rng: np.random.Generator) -> None:
        shown = shown_equations(structure)
        self._names = shown.names
        self._equations = {e.left: e for e in shown.equations if isinstance(e.left, sp.Symbol)}
        self._masses = [e for e in shown.equations if not isinstance(e.left, sp.Symbol)]
        self._states = set(structure.states)
        self.now = float(rng.uniform(0.0, 5.0))
        self.numbers = {symbol: float(rng.uniform(0.3, 0.9)) for symbol in structure.parameter_symbols}
        self.numbers |= {state: float(rng.normal()) for state in structure.states}
        for state, half_width in (e.limit for e in shown.equations if e.limit is not None):
            # At both ends of its range, where no rounding puts it inside again, and well inside.
            place = rng.choice([-1.0 - 1e-9, 1.0 + 1e-9, rng.uniform(-0.9, 0.9)])
            self.numbers[state] = place * self.value(half_width, self.now)
        self._amplitude, self._frequency = rng.normal(), rng.uniform(0.5, 2.0)

    def rest_at_ends(self) -> None:
        """Put what is beyond an end of its range, by no more than rounding, exactly there."""
        for equation in self._equations.values():
            if equation.limit is not None:
                state, half_width = equation.limit
                end = self.value(half_width, self.now)
                self.numbers[state] = min(max(self.numbers[state], -end), end)

    def source(self, time: float) -> float:
        return float(self._amplitude * math.sin(self._frequency * time))

    def source_rate(self, time: float) -> float:
        return float(self._amplitude * self._frequency * math.cos(self._frequency * time))

    def value(self, expression: sp.Expr, time: float) -> float:
        """Evaluate an expression at a time."""
        if isinstance(expression, late):
            signal, delay = expression.args
            return self.value(signal, time - self.value(delay, time))
        known = {symbol: self._symbol(symbol, time) for symbol in expression.free_symbols}
        return _number(expression, known)

    def rate(self, state: sp.Symbol) -> float:
        """Return the rate of a state, by the equation that has it on its left, or by its dots."""
        if state in self._dotted:
            return self._symbol(self._dotted[state], self.now)
        symbol = rate_symbol(state)
        for equation in self._masses:
            mass = sp.diff(equation.left, symbol)
            if mass != 0:
                return self._sum(equation, self.now) / self.value(mass, self.now)
        equation = self._equations[symbol]
        rate = self._sum(equation, self.now)
        if equation.limit is not None:
            half_width = self.value(equation.limit[1], self.now)
            held = rate * self.numbers[state] > 0.0 and abs(self.numbers[state]) >= half_width
            return 0.0 if held else rate
        return rate

    def output(self, name: str, time: float) -> float:
        """Return an output as it is recorded at a time."""
        symbol = output_symbol(name)
        if symbol in self._equations:
            return self._symbol(symbol, time)
        (state,) = (s for s in self._states if self._names[s].plain == name)
        return self._symbol(state, time)

    @property
    def _dotted(self) -> dict[sp.Symbol, sp.Symbol]:
        """States whose rate has a name with a dot more, and that name's symbol."""
        by_name = {self._names[state]: state for state in self._states}
        return {
            by_name[name]: symbol
            for symbol in self._states
            for name in by_name
            if name.dotted() == self._names[symbol]
        }

    def _symbol(self, symbol: sp.Symbol, time: float) -> float:
        if symbol in self._equations:
            return self._sum(self._equations[symbol], time)
        if symbol in self.numbers:
            # What a state was at another time is not known: where it is asked for, a delay stands in the wrong place.
            assert symbol not in self._states or time == pytest.approx(self.now)
            return self.numbers[symbol]
        if symbol == INPUT:
            return self.source(time)
        if symbol == TIME:
            return time
        (below,) = (s for s, name in self._names.items() if name.dotted() == self._names[symbol])
        return self._change(below, time)

    def _change(self, symbol: sp.Symbol, time: float) -> float:
        """Return what a dot above a symbol means: its time derivative, along those of what it is made of."""
        if symbol in self._states:
            return self.rate(symbol)
        if symbol == INPUT:
            return self.source_rate(time)
        if symbol not in self._equations:
            return 0.0
        expression = sp.Add(*self._equations[symbol].terms)
        return sum(
            self.value(sp.diff(expression, part), time) * self._change(part, time)
            for part in expression.free_symbols
        )

    def _sum(self, equation: ShownEquation, time: float) -> float:
        signs = {"": 1.0, "+": 1.0, "-": -1.0}
        return sum(signs[sign] * self.value(term, time) for sign, term in equation.signed_terms)


@cache
def _function(expression: sp.Expr, symbols: tuple[sp.Symbol, ...]):
    known = [{"positive_part": lambda value: np.maximum(value, 0.0)}, "numpy"]
    return sp.lambdify(list(symbols), expression, known)


def _number(expression: sp.Expr, known: dict[sp.Symbol, float]) -> float:
    symbols = tuple(sorted(known, key=str))
    return float(_function(expression, symbols)(*(known[s] for s in symbols)))


@pytest.mark.parametrize(("rig", "names"), CASES, ids=["+".join([rig, *names]) for rig, names in CASES])
def test_what_is_shown_is_what_is_simulated(simulated_instant, rig: str, names: Sequence[str]) -> None:
    structure = compose(RIGS[rig], [effect_named(name) for name in names])
    rng = np.random.default_rng(5)
    for _ in range(_INSTANTS):
        reader = Reader(structure, rng)
        instant = simulated_instant(structure, reader.numbers, reader.source, reader.source_rate, reader.now)
        for state in structure.states:
            assert reader.rate(state) == pytest.approx(instant.rates[state], rel=1e-9, abs=1e-12), state
        for i, (name, value) in enumerate(instant.outputs.items()):
            read_at = reader.now + (instant.measured_late if i == 0 else 0.0)
            assert reader.output(name, read_at) == pytest.approx(value, rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize(("rig", "names"), CASES, ids=["+".join([rig, *names]) for rig, names in CASES])
def test_the_compiled_kernel_moves_as_shown(rig: str, names: Sequence[str]) -> None:
    """Over a step so short that nothing but the rates at its start matters."""
    structure = compose(RIGS[rig], [effect_named(name) for name in names])
    kernel = kernel_of(structure)
    rng = np.random.default_rng(6)
    for _ in range(3):
        reader = Reader(structure, rng)
        reader.rest_at_ends()
        value, rate = reader.source(reader.now), reader.source_rate(reader.now)
        if structure.rig.is_driven:
            # So that it does not matter when a delayed input was sent.
            rate = 0.0
            reader.source = lambda _, value=value: value
        held = HeldInput(np.tile([value, rate, 0.0, 0.0], (2, 1)), _MOMENT, 1, continuous=True)
        p = np.array([reader.numbers[symbol] for symbol in structure.parameter_symbols])
        start = np.array([reader.numbers[state] for state in structure.states])
        status, out, end = kernel.simulate_one(held, p, start, 1e-10, 2)
        assert status == 0
        for state, moved in zip(structure.states, (end - start) / _MOMENT, strict=True):
            assert moved == pytest.approx(reader.rate(state), rel=1e-4, abs=1e-4), state
        late = 0.0 if structure.measured_late is None else reader.value(structure.measured_late, reader.now)
        for i, signal in enumerate(structure.rig.outputs):
            shown = reader.output(signal.name, reader.now + (late if i == 0 else 0.0))
            assert out[0, i] == pytest.approx(shown, rel=1e-9, abs=1e-12), signal.name


@pytest.mark.parametrize("rig", ONE_MOTION)
def test_no_two_symbols_of_an_equation_have_the_same_name(rig: str) -> None:
    offered = [effect for effect in CATALOGUE if RIGS[rig].offers(effect)]
    for pair in combinations(offered, 2):
        shown = shown_equations(compose(RIGS[rig], pair))
        used = {
            symbol
            for equation in shown.equations
            for expression in (equation.left, *equation.terms, *(equation.limit or ()))
            for symbol in expression.free_symbols
        }
        assert len({shown.names[symbol] for symbol in used}) == len(used), [effect.name for effect in pair]
