"""What a rig with a tuple of effects is for a simulation: its parameters, its equations, and these without definitions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from rigsight.effects import Effect
from rigsight.parameters import Parameter
from rigsight.rigs import Rig
from rigsight.simulate.equation_tree import EquationTree, late, rate_within

INPUT = sp.Symbol("input value", real=True)
INPUT_RATE = sp.Symbol("input rate", real=True)
INPUT_CURVATURE = sp.Symbol("input curvature", real=True)
"""The first input of a rig, and its first and second derivative by time; names of a rig hold no blank, so none is called so."""
TIME = sp.Symbol("time now", real=True)


def input_symbols(index: int) -> tuple[sp.Symbol, sp.Symbol, sp.Symbol]:
    """Return the symbols of one of a rig's inputs, of its first and of its second derivative by time."""
    if index == 0:
        return INPUT, INPUT_RATE, INPUT_CURVATURE
    value, rate, curvature = (
        sp.Symbol(f"{s.name} {index}", real=True) for s in (INPUT, INPUT_RATE, INPUT_CURVATURE)
    )
    return value, rate, curvature


@dataclass(frozen=True)
class StateEquation:
    """One state of a structure: its rate, its dimension and the half-width of the range it cannot leave, if any."""

    symbol: sp.Symbol
    rate: sp.Expr
    dimension: str
    limit: sp.Expr | None = None

    @property
    def limited_rate(self) -> sp.Expr:
        """The rate, zero while the state is driven against an end of its range."""
        return rate_within(self.symbol, self.rate, self.limit)


@dataclass(frozen=True)
class Structure:
    """The equations of a rig with its effects.

    Attributes
    ----------
    rig, effects
        What was composed; the effects in the order of the signal path.
    fixed
        Effect parameters written into the equations as numbers.
    parameters, parameter_symbols
        Constants, rig parameters and effect parameters with units, and their symbols; names are unique.
    tree
        The equations: named definitions, motion, states and outputs. What follows from it here holds no definitions.
    """

    rig: Rig
    effects: tuple[Effect, ...]
    fixed: tuple[tuple[str, float], ...]
    parameters: tuple[Parameter, ...]
    parameter_symbols: tuple[sp.Symbol, ...]
    tree: EquationTree

    @cached_property
    def equations(self) -> tuple[StateEquation, ...]:
        """The states with their rates, dimensions and limits: coordinates, velocities, then the others."""
        tree, motion = self.tree, self.tree.motion
        coordinates = zip(motion.coordinates, motion.velocities, motion.dimensions, strict=True)
        velocities = zip(motion.velocities, motion.accelerations, motion.rate_dimensions, strict=True)
        return (
            *(StateEquation(*coordinate) for coordinate in coordinates),
            *(StateEquation(symbol, tree.flattened(rate), size) for symbol, rate, size in velocities),
            *(
                StateEquation(state.symbol, tree.flattened(state.rate), state.dimension, state.limit)
                for state in tree.states
            ),
        )

    @cached_property
    def outputs(self) -> tuple[sp.Expr, ...]:
        """The rig's outputs as expressions."""
        return tuple(self.tree.flattened(sp.Add(*output.terms)) for output in self.tree.outputs)

    @cached_property
    def delay(self) -> sp.Expr | None:
        """Time by which the input arrives late, or None."""
        arriving = [
            self.tree.lateness(d.symbol) for d in self.tree.definitions if isinstance(d.expression, late)
        ]
        delays = [delay for source, delay in arriving if source == INPUT]
        return delays[-1] if delays else None

    @cached_property
    def measured_late(self) -> sp.Expr | None:
        """Time by which the first output is measured late, or None."""
        reading = sp.Add(*self.tree.outputs[0].terms)
        return self.tree.lateness(reading)[1]

    @property
    def velocity_index(self) -> int | None:
        """Index of the velocity of the moving mass among the states, None where the motion is prescribed."""
        return len(self.tree.motion.coordinates) or None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def computed_outputs(self) -> tuple[sp.Expr, ...]:
        """The outputs, and behind them the rate of the first where it is measured late: it is interpolated with it."""
        if self.measured_late is None:
            return self.outputs
        reading = self.outputs[0]
        rate = sum((sp.diff(reading, s.symbol) * s.rate for s in self.equations), start=sp.Integer(0))
        return (*self.outputs, rate)

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

    def values_of(self, effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
        """Return an effect's own values by their own names, out of values of this structure."""
        names = {p.name: self.parameter_name(effect, p.name) for p in effect.parameters}
        return {own: values[name] for own, name in names.items() if name in values}


def carried_over(values: Mapping[str, float], source: Structure, target: Structure) -> dict[str, float]:
    """Return values of one structure by the names that they have in another, as far as it has them.

    An effect's parameter may be qualified in one and not in the other.
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


def unique_names(rig: Rig, effects: tuple[Effect, ...]) -> dict[tuple[str, str], str]:
    """Return the unique name of each effect's parameter by (effect, own name)."""
    names = [p.name for p in (*rig.constants, *rig.parameters)]
    names += [p.name for effect in effects for p in effect.parameters]
    return {
        (effect.name, p.name): f"{effect.name}.{p.name}" if names.count(p.name) > 1 else p.name
        for effect in effects
        for p in effect.parameters
    }
