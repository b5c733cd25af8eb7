"""What is shown is what is simulated: every shown equation, evaluated, against the simulation at random instants."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from itertools import combinations
from typing import Any

import numpy as np
import pytest
import sympy as sp

from rigsight.effects import CATALOGUE, Effect, effect_named, placed
from rigsight.rigs import RIGS
from rigsight.simulate import Structure, compose
from rigsight.simulate.compiled.kernel import kernel_of
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.equations.tree import late
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.printing.names import declared_name, output_symbol, rate_symbol
from rigsight.simulate.printing.shown import ShownEquation, shown_equations

from ...tiers import slow_but

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
ONE_MOTION = sorted(
    (name for name, rig in RIGS.items() if rig.has_one_motion), key=lambda name: name != "axis"
)
LARGER = [name for name in RIGS if name not in ONE_MOTION]
_TOGETHER_AT_PLACES = (
    ("drive_train", "backlash@shaft", "coulomb_friction@load_bearing", "coulomb_friction@motor_bearing"),
    ("drive_train", "bouc_wen_hysteresis@shaft", "input_saturation@motor", "sensor_lag@load_angle", "sensor_lag@motor_angle"),
    ("servo", "sensor_lag@angle", "input_saturation@motor", "actuator_lag@motor", "stribeck_friction@gearbox"),
    ("two_link_arm", "input_dead_zone@shoulder_motor", "input_dead_zone@elbow_motor", "cubic_stiffness@elbow"),
    ("quarter_car", "cubic_stiffness@tire", "cubic_stiffness@suspension", "quadratic_damping@suspension"),
)  # fmt: skip
CASES = [
    (rig, names)
    for rig in ONE_MOTION
    for names in ((), *((effect.name,) for effect in CATALOGUE), *_TOGETHER)
    if all(RIGS[rig].offers(effect_named(name)) for name in names)
]


def composed(rig: str, names: Sequence[str]) -> Structure:
    """A rig with effects, each at its place where one is named."""
    parts = [name.partition("@") for name in names]
    chosen = [placed(effect_named(kind), place) if place else effect_named(kind) for kind, _, place in parts]
    return compose(RIGS[rig], chosen)


def is_a_delay(effect: Effect) -> bool:
    return effect.delay is not None or effect.reading_delay is not None


def one_place_each(rig: str) -> list[tuple[str, tuple[str, ...]]]:
    """Every effect at one place of a rig, the next effect at the next place."""
    found = []
    for number, effect in enumerate(CATALOGUE):
        at = [p for p in RIGS[rig].places(effect.place) if RIGS[rig].offers(placed(effect, p))]
        if at and not is_a_delay(effect):
            found.append((rig, (f"{effect.name}@{at[number % len(at)]}",)))
    return found


AT_PLACES = [
    *((rig, ()) for rig in LARGER),
    *(case for rig in LARGER for case in one_place_each(rig)),
    *((rig, names) for rig, *names in _TOGETHER_AT_PLACES),
]
"""Every effect on every rig, the places in turn; delays have a memory of their own and their own tests."""
KERNELS = [*CASES, *(case for case in AT_PLACES if len(case[1]) != 1)]
_INSTANTS = 12
_MOMENT = 1e-6
"""Step of the compiled kernel [s]; the rates here change by about their size in a second."""


class Reader:
    """Somebody who has the page, numbers and a pocket calculator: knows the shown equations and nothing of the tree."""

    def __init__(self, structure: Structure, rng: np.random.Generator) -> None:
        shown = shown_equations(structure)
        self._names = shown.names
        self._equations = {e.left: e for e in shown.equations if not e.inertia}
        self._motion = [e for e in shown.equations if e.inertia]
        self._states = set(structure.states)
        self.now = float(rng.uniform(0.0, 5.0))
        self.numbers = {symbol: float(rng.uniform(0.3, 0.9)) for symbol in structure.parameter_symbols}
        self.numbers |= {state: float(rng.normal()) for state in structure.states}
        for state, half_width in (e.limit for e in shown.equations if e.limit is not None):
            # At both ends of its range, where no rounding puts it inside again, and well inside.
            place = rng.choice([-1.0 - 1e-9, 1.0 + 1e-9, rng.uniform(-0.9, 0.9)])
            self.numbers[state] = place * self.value(half_width, self.now)
        self._inputs = [
            (input_symbols(i), rng.normal(), rng.uniform(0.5, 2.0)) for i in range(len(structure.rig.inputs))
        ]

    def rest_at_ends(self) -> None:
        """Put what is beyond an end of its range, by no more than rounding, exactly there."""
        for equation in self._equations.values():
            if equation.limit is not None:
                state, half_width = equation.limit
                end = self.value(half_width, self.now)
                self.numbers[state] = min(max(self.numbers[state], -end), end)

    def source(self, index: int, time: float, derivative: int = 0) -> float:
        """Return an input, or a derivative of it: waves of different periods."""
        _, amplitude, frequency = self._inputs[index]
        return float(
            amplitude * frequency**derivative * math.sin(frequency * time + 0.5 * math.pi * derivative)
        )

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
        accelerations = list(dict.fromkeys(rate for e in self._motion for _, rate in e.inertia))
        if symbol in accelerations:
            masses = [
                [
                    self.value({r: m for m, r in e.inertia}.get(rate, sp.Integer(0)), self.now)
                    for rate in accelerations
                ]
                for e in self._motion
            ]
            forces = [self._sum(equation, self.now) for equation in self._motion]
            return float(np.linalg.solve(masses, forces)[accelerations.index(symbol)])
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
        # What the rig has under the column's name already.
        (column,) = (s for s in (*self._states, *self._equations) if self._names[s] == declared_name(name))
        return self._symbol(column, time)

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
        for index, (derivatives, *_) in enumerate(self._inputs):
            if symbol == derivatives[0]:
                return self.source(index, time)
        if symbol == TIME:
            return time
        (below,) = (s for s, name in self._names.items() if name.dotted() == self._names[symbol])
        return self._change(below, time)

    def _change(self, symbol: sp.Symbol, time: float) -> float:
        """Return what a dot above a symbol means: its time derivative, along those of what it is made of."""
        if symbol in self._states:
            return self.rate(symbol)
        for index, (derivatives, *_) in enumerate(self._inputs):
            if symbol in derivatives[:2]:
                return self.source(index, time, derivatives.index(symbol) + 1)
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
    limits = {"min": np.minimum, "max": np.maximum, "clip": np.clip}
    known = [{"positive_part": lambda value: np.maximum(value, 0.0), **limits}, "numpy"]
    return sp.lambdify(list(symbols), expression, known)


def _number(expression: sp.Expr, known: dict[sp.Symbol, float]) -> float:
    symbols = tuple(sorted(known, key=str))
    return float(_function(expression, symbols)(*(known[s] for s in symbols)))


def _of_tiers(cases: Sequence[tuple[str, Sequence[str]]]) -> list[Any]:
    """Return cases of which `make test` takes each rig, and each effect or company of effects on one rig."""
    seen: set[tuple[str, ...]] = set()
    found = []
    for case, label in zip(cases, _ids(cases), strict=True):
        kinds = tuple(name.partition("@")[0] for name in case[1])
        marks = pytest.mark.slow if kinds and kinds in seen else ()
        found.append(pytest.param(*case, id=label, marks=marks))
        seen.add(kinds)
    return found


def _ids(cases: Sequence[tuple[str, Sequence[str]]]) -> list[str]:
    return ["+".join([rig, *names]) for rig, names in cases]


@pytest.mark.parametrize(("rig", "names"), _of_tiers([*CASES, *AT_PLACES]))
def test_what_is_shown_is_what_is_simulated(simulated_instant, rig: str, names: Sequence[str]) -> None:
    structure = composed(rig, names)
    rng = np.random.default_rng(5)
    for _ in range(_INSTANTS):
        reader = Reader(structure, rng)
        instant = simulated_instant(structure, reader.numbers, reader.source, reader.now)
        for state in structure.states:
            assert reader.rate(state) == pytest.approx(instant.rates[state], rel=1e-9, abs=1e-12), state
        for i, (name, value) in enumerate(instant.outputs.items()):
            read_at = reader.now + (instant.reading_delay if i == 0 else 0.0)
            assert reader.output(name, read_at) == pytest.approx(value, rel=1e-9, abs=1e-12), name


@pytest.mark.parametrize(("rig", "names"), _of_tiers(KERNELS))
def test_the_compiled_kernel_moves_as_shown(rig: str, names: Sequence[str]) -> None:
    """Over a step so short that nothing but the rates at its start matters."""
    structure = composed(rig, names)
    kernel = kernel_of(structure)
    prescribed = {coordinate.prescribed_by for coordinate in structure.rig.mechanism.prescribed}
    follows = [signal.name in prescribed for signal in structure.rig.inputs]
    rng = np.random.default_rng(6)
    for _ in range(3):
        reader = Reader(structure, rng)
        reader.rest_at_ends()
        waves, now = reader.source, reader.now

        def held_still(index: int, time: float, derivative: int = 0, waves=waves, now=now) -> float:
            """Between the samples of a moment: along its slope where a motion follows it, else constant, whenever it was sent."""
            if derivative > 1 or (derivative == 1 and not follows[index]):
                return 0.0
            start = waves(index, now, derivative)
            return start + (time - now) * waves(index, now, 1) * (follows[index] and derivative == 0)

        reader.source = held_still
        pieces = [[held_still(i, now), held_still(i, now, 1), 0.0, 0.0] for i in range(len(follows))]
        coefficients = np.array([pieces, pieces]) if len(follows) > 1 else np.array([pieces[0], pieces[0]])
        held = HeldInput(coefficients, _MOMENT, 1, continuous=True)
        p = np.array([reader.numbers[symbol] for symbol in structure.parameter_symbols])
        start = np.array([reader.numbers[state] for state in structure.states])
        status, out, end = kernel.simulate_one(held, p, start, 1e-10, 2)
        assert status == 0
        for state, moved in zip(structure.states, (end - start) / _MOMENT, strict=True):
            assert moved == pytest.approx(reader.rate(state), rel=1e-4, abs=1e-4), state
        late = (
            0.0
            if structure.first_shown_late is None
            else reader.value(structure.first_shown_late, reader.now)
        )
        for i, signal in enumerate(structure.rig.outputs):
            shown = reader.output(signal.name, reader.now + (late if i == 0 else 0.0))
            assert out[0, i] == pytest.approx(shown, rel=1e-9, abs=1e-12), signal.name


@pytest.mark.parametrize("rig", slow_but("axis", of=ONE_MOTION))
def test_no_two_symbols_of_an_equation_have_the_same_name(rig: str) -> None:
    offered = [effect for effect in CATALOGUE if RIGS[rig].offers(effect)]
    for pair in combinations(offered, 2):
        assert_names_differ(compose(RIGS[rig], pair))


@pytest.mark.parametrize(("rig", "names"), _of_tiers(AT_PLACES))
def test_no_two_symbols_of_a_larger_rig_have_the_same_name(rig: str, names: Sequence[str]) -> None:
    assert_names_differ(composed(rig, names))


def assert_names_differ(structure: Structure) -> None:
    shown = shown_equations(structure)
    used = {
        symbol
        for equation in shown.equations
        for expression in (equation.left, *equation.terms, *(equation.limit or ()))
        for symbol in expression.free_symbols
    }
    assert len({shown.names[symbol] for symbol in used}) == len(used), structure.effect_names
