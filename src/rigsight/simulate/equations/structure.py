"""A rig with a tuple of effects for simulation: its parameters, and its equations with and without definitions."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import sympy as sp

from rigsight.effects import Effect
from rigsight.effects.symbols import rate_along
from rigsight.parameters import Parameter
from rigsight.rigs import Rig, joint_of
from rigsight.simulate.equations.elimination import Elimination, steps_to_accelerations
from rigsight.simulate.equations.tree import EquationTree, FirstOrderState, late

INPUT = sp.Symbol("input value", real=True)
INPUT_RATE = sp.Symbol("input rate", real=True)
INPUT_CURVATURE = sp.Symbol("input curvature", real=True)
"""The first input of a rig, and its first and second time derivative; names of a rig contain no blank, so none conflicts."""
TIME = sp.Symbol("time now", real=True)


def input_symbols(index: int) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
    """Return the symbols of one of a rig's inputs and of its first and second time derivative."""
    if index == 0:
        return INPUT, INPUT_RATE, INPUT_CURVATURE
    value, rate, curvature = (
        sp.Symbol(f"{s.name} {index}", real=True) for s in (INPUT, INPUT_RATE, INPUT_CURVATURE)
    )
    return value, rate, curvature


def input_rates(count: int) -> dict[sp.Symbol, sp.Symbol]:
    """Return the inputs and their rates, each with its time derivative."""
    return {symbol: rate for index in range(count) for symbol, rate in pairwise(input_symbols(index))}


@dataclass(frozen=True)
class History:
    """A signal that is delayed within the rig, so that its history is stored."""

    symbol: sp.Symbol  # symbol of the delayed signal
    signal: sp.Expr  # the signal as an expression in states, inputs, parameters and other histories
    delay: sp.Expr  # the delay as an expression in parameters


@dataclass(frozen=True)
class LateInput:
    """An input that arrives late."""

    index: int  # of the input
    delay: sp.Expr  # as an expression in parameters
    value: sp.Symbol  # what arrives
    rate: sp.Symbol  # its time derivative


@dataclass(frozen=True, eq=False)
class Structure:
    """The equations of a rig with its effects.

    Structures are compared by identity, which makes them keys of caches: their rigs contain dictionaries. `compose` returns the
    same one for the same rig and effects.

    Attributes
    ----------
    rig, effects
        The rig, and its effects in the order of the signal path.
    fixed
        Effect parameters written into the equations as numbers.
    parameters, parameter_symbols
        Constants, rig parameters and effect parameters with units, and their symbols; names are unique.
    tree
        The equations: named definitions, motion, states and outputs. The equations derived from it here have no definitions.
    offsets
        Sensors whose readings are shifted by the last states, in their order.
    observed
        Sensors of an observer, which corrects the motion towards their measured readings; these inputs follow those of the rig.
    """

    rig: Rig
    effects: tuple[Effect, ...]
    fixed: tuple[tuple[str, float], ...]
    parameters: tuple[Parameter, ...]
    parameter_symbols: tuple[sp.Symbol, ...]
    tree: EquationTree
    offsets: tuple[str, ...] = ()
    observed: tuple[str, ...] = ()

    @property
    def n_inputs(self) -> int:
        """Number of the rig's inputs and of the readings that an observer uses."""
        return len(self.rig.inputs) + len(self.observed)

    @cached_property
    def equations(self) -> tuple[FirstOrderState, ...]:
        """The states with their rates, dimensions and limits: coordinates, velocities, then the others.

        They contain no delays.
        """
        return self._equations(self.tree.flattened)

    @cached_property
    def remembering_equations(self) -> tuple[FirstOrderState, ...]:
        """The same with the symbols of `histories`, as used in the simulation."""
        return self._equations(self.tree.remembering) if self.histories else self.equations

    def _equations(self, flattened: Callable[[sp.Expr], sp.Expr]) -> tuple[FirstOrderState, ...]:
        tree, motion = self.tree, self.tree.motion
        coordinates = zip(motion.coordinates, motion.velocities, motion.dimensions, strict=True)
        velocities = zip(motion.velocities, motion.accelerations, motion.rate_dimensions, strict=True)
        return (
            *(FirstOrderState(symbol, (rate,), size) for symbol, rate, size in coordinates),
            *(FirstOrderState(symbol, (flattened(rate),), size) for symbol, rate, size in velocities),
            *(replace(state, terms=(flattened(state.rate),)) for state in tree.states),
        )

    @property
    def out_of_balance(self) -> tuple[sp.Expr, ...]:
        """An expression for each coordinate that is zero in equilibrium: its acceleration as a formula, or its total force."""
        motion = self.tree.motion
        if self.elimination is not None:
            return tuple(map(self.tree.flattened, motion.forces))
        n = len(motion.coordinates)
        return tuple(equation.rate for equation in self.equations[n : 2 * n])

    @cached_property
    def elimination(self) -> Elimination | None:
        """The elimination for accelerations that appear in the equations as symbols; None if they are formulas."""
        motion = self.tree.motion
        return None if motion.is_written else Elimination.of(motion.mass)

    @cached_property
    def steps(self) -> dict[sp.Symbol, sp.Expr]:
        """Values computed before the equations, symbol by symbol: masses, loads and the steps to the accelerations.

        Empty if accelerations are formulas. They contain no delays.
        """
        return self._steps(self.tree.flattened)

    @cached_property
    def remembering_steps(self) -> dict[sp.Symbol, sp.Expr]:
        """The same with the symbols of `histories`."""
        return self._steps(self.tree.remembering) if self.histories else self.steps

    def _steps(self, flattened: Callable[[sp.Expr], sp.Expr]) -> dict[sp.Symbol, sp.Expr]:
        motion, elimination = self.tree.motion, self.elimination
        if elimination is None:
            return {}
        masses = [flattened(motion.mass[place]) for place in elimination.mass]
        loads = [[flattened(term) for term in terms] for terms in motion.terms]
        return steps_to_accelerations(elimination, masses, loads)

    @cached_property
    def outputs(self) -> tuple[sp.Expr, ...]:
        """The rig's outputs as expressions without delays."""
        return tuple(self.tree.flattened(sp.Add(*output.terms)) for output in self.tree.outputs)

    @cached_property
    def histories(self) -> tuple[History, ...]:
        """Signals that are delayed within the rig and whose history is stored during the simulation."""
        tree = self.tree
        delayed = {d.symbol: d.expression.args for d in tree.definitions if d.symbol in tree.remembered}
        return tuple(
            History(own, tree.remembering(delayed[own][0]), delayed[own][1]) for own in tree.remembered
        )

    @cached_property
    def shown_late(self) -> tuple[sp.Expr | None, ...]:
        """For each output the delay that is applied after the simulation, or None."""
        tree = self.tree
        return tuple(tree.lateness(sp.Add(*output.terms), tree.remembered)[1] for output in tree.outputs)

    @property
    def is_shifted(self) -> bool:
        """Whether outputs are available only after the whole record has been simulated."""
        return any(delay is not None for delay in self.shown_late)

    @cached_property
    def delay(self) -> sp.Expr | None:
        """Delay of the only input, or None."""
        tree = self.tree
        delayed = (d.symbol for d in tree.definitions if isinstance(d.expression, late))
        traced = (tree.lateness(symbol) for symbol in delayed if symbol not in tree.remembered)
        return next(reversed([delay for root, delay in traced if root == INPUT]), None)

    @cached_property
    def late_inputs(self) -> tuple[LateInput, ...] | None:
        """Inputs that arrive late; None if a delayed signal depends on anything but inputs and parameters."""
        if not self.histories:
            return () if self.delay is None else (LateInput(0, self.delay, INPUT, INPUT_RATE),)
        found, known = [], set(self.parameter_symbols)
        indices = {input_symbols(index)[0]: index for index in range(self.n_inputs)}
        for number, history in enumerate(self.histories):
            read = history.signal.free_symbols - known
            if not read <= set(indices):
                return None
            for index in sorted(indices[symbol] for symbol in read):
                value, rate = (
                    sp.Symbol(f"{symbol.name} late by delay {number}", real=True)
                    for symbol in input_symbols(index)[:2]
                )
                found.append(LateInput(index, history.delay, value, rate))
        return tuple(found)

    @cached_property
    def observed_delays(self) -> dict[str, sp.Expr]:
        """Delays of the sensors of an observer as expressions in parameters; sensors without a delay are left out."""
        known: dict[str, sp.Expr] = {name: sp.Float(value) for name, value in self.fixed}
        known |= zip(self.names, self.parameter_symbols, strict=True)
        found: dict[str, sp.Expr] = {}
        for effect in self.effects:
            sensor = self.rig.acts_at(effect)
            if effect.reading_delay is None or sensor not in self.observed:
                continue
            names = {
                sp.Symbol(p.name, real=True): self.parameter_name(effect, p.name) for p in effect.parameters
            }
            values = {own: known[name] for own, name in names.items()}
            found[sensor] = found.get(sensor, sp.Integer(0)) + effect.reading_delay.xreplace(values)
        return found

    @property
    def jumps_at_a_place(self) -> bool:
        """Whether a force jumps at a position: that of a damper parallel to a spring, behind a play."""
        return any(
            effect.deflection is not None and joint_of(self.rig, effect).damps_spring
            for effect in self.effects
        )

    @property
    def first_shown_late(self) -> sp.Expr | None:
        """Delay of the first output that is applied after the simulation, or None."""
        return self.shown_late[0]

    @property
    def velocity_index(self) -> int | None:
        """Index of the (first) velocity among the states, None if the motion is prescribed."""
        return len(self.tree.motion.coordinates) or None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def computed_outputs(self) -> tuple[sp.Expr, ...]:
        """The outputs, followed by the rates of those in `shown_late`, which are needed for their interpolation."""
        shown = self.outputs
        if self.histories:
            shown = tuple(self.tree.remembering(sp.Add(*output.terms)) for output in self.tree.outputs)
        rates = {equation.symbol: equation.rate for equation in self.remembering_equations}
        rates |= input_rates(self.n_inputs)
        late_ones = (s for s, delay in zip(shown, self.shown_late, strict=True) if delay is not None)
        return (*shown, *(rate_along(reading, rates) for reading in late_ones))

    @cached_property
    def accelerating_inputs(self) -> frozenset[int]:
        """Indices of the inputs whose second derivative stands in the equations, as of a prescribed motion of a mass."""
        expressions = [
            *(equation.rate for equation in self.remembering_equations),
            *self.remembering_steps.values(),
            *self.computed_outputs,
        ]
        read = {symbol for expression in expressions for symbol in expression.free_symbols}
        return frozenset(index for index in range(self.n_inputs) if input_symbols(index)[2] in read)

    @property
    def states(self) -> tuple[sp.Symbol, ...]:
        """State symbols in order."""
        return tuple(equation.symbol for equation in self.equations)

    @property
    def state_dimensions(self) -> tuple[str, ...]:
        """Dimension text of each state."""
        return tuple(equation.dimension for equation in self.equations)

    @property
    def state_names(self) -> tuple[str, ...]:
        """State names in order."""
        return tuple(state.name for state in self.states)

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Effect names in the order of the signal path."""
        return tuple(effect.name for effect in self.effects)

    def parameter_name(self, effect: Effect, own_name: str) -> str:
        """Return the name that a parameter of one of the effects has in this structure."""
        return unique_names(self.rig, self.effects)[effect.name, own_name]

    def of_rig(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression of the rig's constants and parameters in the symbols of this structure."""
        own = dict(zip(self.names, self.parameter_symbols, strict=True))
        return expression.xreplace({s: own[s.name] for s in expression.free_symbols})

    @property
    def special_cases(self) -> frozenset[tuple[str, str]]:
        """Parameters that are written into the equations at their special values, each as effect and own name."""
        fixed = dict(self.fixed)
        return frozenset(
            (e.name, own)
            for e in self.effects
            for own in e.special_cases
            if self.parameter_name(e, own) in fixed
        )

    def values_of(self, effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
        """Return an effect's values by their own names, from values of this structure."""
        names = {p.name: self.parameter_name(effect, p.name) for p in effect.parameters}
        return {own: values[name] for own, name in names.items() if name in values}


def bandwidth_name(sensor: str) -> str:
    """Return the name of the bandwidth with which an observer follows a sensor."""
    return f"bandwidth of {sensor}"


def ahead_name(sensor: str) -> str:
    """Return the name of the time by which the measured motion of a delayed sensor is advanced for an observer."""
    return f"reading ahead of {sensor}"


def carried_over(values: Mapping[str, float], source: Structure, target: Structure) -> dict[str, float]:
    """Return values of one structure by their names in another, for the parameters that both have.

    An effect's parameter may have a qualified name in one and not in the other.
    """
    carried = {
        p.name: values[p.name] for p in (*target.rig.constants, *target.rig.parameters) if p.name in values
    }
    for effect in target.effects:
        if effect in source.effects:
            for parameter in effect.parameters:
                name = source.parameter_name(effect, parameter.name)
                if name in values:
                    carried[target.parameter_name(effect, parameter.name)] = values[name]
    return carried


def special_values(
    rig: Rig, effects: Iterable[Effect], beside: Iterable[Effect] = (), like: Structure | None = None
) -> dict[str, float]:
    """Return the special values of effects, which shorten the equations, by their names in a structure with other effects.

    Left out are those that are free in another structure with the same effect.
    """
    effects = tuple(effects)
    names = unique_names(rig, (*effects, *beside))
    released = set()
    if like is not None:
        released = {
            (effect.name, own) for effect in like.effects for own in effect.special_cases
        } - like.special_cases
    return {
        names[effect.name, own]: value
        for effect in effects
        for own, value in effect.special_cases.items()
        if (effect.name, own) not in released
    }


def unique_names(rig: Rig, effects: tuple[Effect, ...]) -> dict[tuple[str, str], str]:
    """Return the unique name of each effect's parameter by (effect, own name)."""
    names = [p.name for p in (*rig.constants, *rig.parameters)]
    names += [p.name for effect in effects for p in effect.parameters]
    return {
        (effect.name, p.name): f"{effect.name}.{p.name}" if names.count(p.name) > 1 else p.name
        for effect in effects
        for p in effect.parameters
    }
