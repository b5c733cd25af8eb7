"""The equations of a rig with effects before substitution: one tree from which all other forms are derived."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property

import sympy as sp

from rigsight.effects.symbols import derivative, positive_part, rate_along
from rigsight.rigs import Coordinate, Rig, applied_symbol, has_short_inverse
from rigsight.simulate.equations.elimination import acceleration_symbols
from rigsight.units import size_of

Bound = Callable[[sp.Expr], sp.Expr]


class Kind(StrEnum):
    """Kinds of named values in the equations."""

    SIGNAL = "signal"
    DRIVE = "drive"
    DEFLECTION = "deflection"
    DEFLECTION_RATE = "deflection_rate"
    SPRING = "spring_torque"
    TORQUE = "torque"
    LOAD = "load"
    LATERAL = "lateral_rate"
    READING = "reading"


class late(sp.Function):  # type: ignore[misc]  # noqa: N801
    """First argument delayed by the second; always the whole expression of a definition, never a part of one."""

    is_real = True


class shifted(late):  # noqa: N801
    """The same for a reading that is only recorded: its record is shifted as a whole, in either direction."""


@dataclass(frozen=True)
class Definition:
    """A named value: the output of an effect, or a named quantity of the rig."""

    symbol: sp.Symbol  # its symbol in later definitions and equations
    # Its expression in inputs, states, parameters and earlier definitions; a delay is `late` of a signal.
    expression: sp.Expr
    kind: Kind  # its kind in the signal path
    owner: str | None  # name of the effect to which it belongs; None for the rig
    # Symbol of the definition whose time derivative this is, if it is one; it is displayed as a dot instead
    # of an equation.
    rate_of: sp.Symbol | None = None
    # Its name in the rig: a signal, a drive with a control law, a sensor read by a law. None for that of an
    # effect.
    name: str | None = None


@dataclass(frozen=True)
class EquationsOfMotion:
    """``mass @ accelerations = forces``, for n degrees of freedom; n = 0 if the motion is prescribed."""

    # Symbols of the states, n each.
    coordinates: tuple[sp.Symbol, ...] = ()
    velocities: tuple[sp.Symbol, ...] = ()
    # Mass matrix (n, n) in terms of parameters, coordinates and definitions.
    mass: sp.ImmutableMatrix = field(default_factory=lambda: sp.ImmutableMatrix(0, 0, []))
    # The parts of the generalized force of each coordinate, with their signs, in display order.
    terms: tuple[tuple[sp.Expr, ...], ...] = ()
    # Dimension texts of the coordinates and of the velocities, n each.
    dimensions: tuple[str, ...] = ()
    rate_dimensions: tuple[str, ...] = ()

    @property
    def forces(self) -> tuple[sp.Expr, ...]:
        """Generalized forces, one for each coordinate."""
        return tuple(sp.Add(*terms) for terms in self.terms)

    @cached_property
    def is_written(self) -> bool:
        """True if the accelerations are formulas, False if they are symbols whose values come from `Elimination`."""
        return has_short_inverse(self.mass)

    @property
    def accelerations(self) -> tuple[sp.Expr, ...]:
        """Rates of the velocities: inverse of the mass matrix times forces, or symbols, see `is_written`."""
        if not self.is_written:
            return acceleration_symbols(len(self.coordinates))
        if len(self.coordinates) == 1:
            return (self.forces[0] / self.mass[0, 0],)
        return tuple(self.mass.LUsolve(sp.Matrix(self.forces))) if self.coordinates else ()


@dataclass(frozen=True)
class FirstOrderState:
    """A state and its rate: in a tree one other than the motion, a memory, a lag, the lateral displacement."""

    symbol: sp.Symbol
    terms: tuple[sp.Expr, ...]  # the parts of its rate, in display order
    dimension: str  # dimension text
    limit: sp.Expr | None = None  # half-width of the range that it cannot leave, if any
    owner: str | None = None  # name of the effect to which it belongs; None for the rig

    @property
    def rate(self) -> sp.Expr:
        """The rate inside the range."""
        return sp.Add(*self.terms)

    @property
    def limited_rate(self) -> sp.Expr:
        """The rate; zero while the state is at an end of its range and the rate points outward."""
        if self.limit is None:
            return self.rate
        return self.rate * (1 - sp.sign(self.symbol * sp.sign(self.rate) - self.limit)) / 2


@dataclass(frozen=True)
class Output:
    """A recorded quantity: the name of its column, and the terms of its sum in display order."""

    name: str
    terms: tuple[sp.Expr, ...]


@dataclass(frozen=True)
class EquationTree:
    """The equations of a rig with effects; every expression refers to the definitions."""

    inputs: tuple[sp.Symbol, ...]  # symbols of the recorded inputs of the rig, before any delay
    definitions: tuple[Definition, ...]  # named values in the order of evaluation
    motion: EquationsOfMotion  # the equations of motion
    states: tuple[FirstOrderState, ...]  # the states other than the motion
    outputs: tuple[Output, ...]  # the recorded quantities

    def flattened(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression without definitions and without delays."""
        return expression.xreplace(self._values)

    def remembering(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression without definitions, except those in `remembered`, which keep their symbols."""
        return expression.xreplace(self._remembering_values)

    @cached_property
    def remembered(self) -> tuple[sp.Symbol, ...]:
        """Delayed definitions whose history must be stored during the simulation, in the order of definition."""
        # These are all but two kinds: the delayed only input of a rig, where the whole record is shifted; and a reading that is
        # only recorded, which is shifted after the simulation if its rate has no jumps between samples.
        delayed = [d.symbol for d in self.definitions if isinstance(d.expression, late)]
        within = [s for s in delayed if not self._is_arrival(s) and not self._is_shown_late(s)]
        # Beside a history the record cannot be shifted as a whole.
        return tuple(s for s in delayed if s in within or (within and self._is_arrival(s)))

    def _readers(self, symbol: sp.Symbol) -> tuple[list[sp.Symbol], bool, bool]:
        """Return the definitions that contain a symbol, whether the motion or a state does, and whether an output does."""
        read = [d.symbol for d in self.definitions if symbol in d.expression.free_symbols]
        moving = [*self.motion.mass, *(term for terms in self.motion.terms for term in terms)]
        moving += [part for s in self.states for part in (*s.terms, s.limit or sp.Integer(0))]
        shown = any(symbol in term.free_symbols for output in self.outputs for term in output.terms)
        return read, any(symbol in expression.free_symbols for expression in moving), shown

    def _is_arrival(self, symbol: sp.Symbol) -> bool:
        """Return True for the delayed only input of a rig, if the rig does not use it without the delay."""
        root, _ = self.lateness(symbol)
        while root != symbol:
            read, moves, shown = self._readers(root)
            if len(self.inputs) != 1 or len(read) != 1 or moves or shown:
                return False
            if root not in (*self.inputs, *self._expressions) or not isinstance(
                self._expressions[read[0]], late
            ):
                return False
            root = read[0]
        return self.lateness(symbol)[0] in self.inputs

    def _is_shown_late(self, symbol: sp.Symbol) -> bool:
        """Return True for a reading that is only recorded, and whose rate depends on states alone and has no kinks."""
        # If the record is shifted as a whole, rate and kinks do not matter.
        if isinstance(self._expressions[symbol], shifted):
            return True
        last, (reading, _) = symbol, self.lateness(symbol)
        while True:
            read, moves, shown = self._readers(last)
            if moves or len(read) + shown != 1 or (shown and (last,) not in [o.terms for o in self.outputs]):
                return False
            if shown:
                break
            last = read[0]
            if not isinstance(self._expressions[last], late):
                return False
        parts = [self.rate_of(reading)]
        if not self.motion.is_written and parts[0].free_symbols & set(self.motion.accelerations):
            parts += map(self.flattened, (*self.motion.mass, *self.motion.forces))
        return not any(
            part.free_symbols & set(self.inputs) or part.atoms(sp.sign, sp.Abs, positive_part)
            for part in parts
        )

    def rate_of(self, reading: sp.Expr) -> sp.Expr:
        """Return the time derivative of an expression of the states, without delays."""
        motion, flat = self.motion, self.flattened(reading)
        rates = dict(zip(motion.coordinates, motion.velocities, strict=True))
        rates |= zip(motion.velocities, motion.accelerations, strict=True)
        rates |= {state.symbol: state.rate for state in self.states}
        return rate_along(
            flat, {s: self.flattened(rate) for s, rate in rates.items() if s in flat.free_symbols}
        )

    def lateness(self, symbol: sp.Symbol, kept: Sequence[sp.Symbol] = ()) -> tuple[sp.Symbol, sp.Expr | None]:
        """Return the symbol or expression before all delays but those `kept`, and the total delay; None without a delay."""
        delays: list[sp.Expr] = []
        while symbol not in kept and isinstance(expression := self._expressions.get(symbol), late):
            symbol, delay = expression.args
            delays.append(delay)
        return symbol, sp.Add(*delays) if delays else None

    @cached_property
    def _expressions(self) -> Mapping[sp.Symbol, sp.Expr]:
        return {definition.symbol: definition.expression for definition in self.definitions}

    @cached_property
    def _values(self) -> Mapping[sp.Symbol, sp.Expr]:
        return self._values_without(())

    @cached_property
    def _remembering_values(self) -> Mapping[sp.Symbol, sp.Expr]:
        return self._values_without(self.remembered)

    def _values_without(self, kept: Sequence[sp.Symbol]) -> Mapping[sp.Symbol, sp.Expr]:
        values: dict[sp.Symbol, sp.Expr] = {}
        for symbol, expression in self._expressions.items():
            if symbol not in kept:
                values[symbol] = (
                    expression.args[0] if isinstance(expression, late) else expression
                ).xreplace(values)
        return values


def equations_of_motion(
    rig: Rig, bound: Bound, resisting: Mapping[str, tuple[sp.Expr, ...]], pulled: sp.Matrix | None = None
) -> EquationsOfMotion:
    """Return the equations of motion of a rig with n degrees of freedom."""
    mechanism, free = rig.mechanism, rig.mechanism.free
    terms: list[list[sp.Expr]] = [[] for _ in free]

    def add(along: sp.Expr, forces: Sequence[sp.Expr]) -> None:
        for own, coordinate in zip(terms, free, strict=True):
            slope = bound(derivative(along, coordinate.symbol))
            own += [slope * force for force in forces if slope != 0]

    for drive in mechanism.drives:
        add(drive.along, [bound(drive.force)])
    for joint in mechanism.joints:
        add(joint.motion, [-term for term in resisting[joint.name]])
    for own, force in zip(terms, mechanism.generalized_forces, strict=True):
        if force != 0:
            own.append(bound(force))
    if mechanism.bodies is not None:
        # The constraint forces of simulated bodies depend on all other applied forces.
        applied = {applied_symbol(i): sp.Add(*own) for i, own in enumerate(terms)}
        for own, force in zip(terms, mechanism.simulated_forces, strict=True):
            own.append(bound(force).xreplace(applied))
    mass = sp.ImmutableMatrix(mechanism.mass_matrix.applyfunc(bound))
    if pulled is not None:
        for own, force in zip(terms, mass * pulled, strict=True):
            own.append(force)
    one = mechanism.has_one_motion
    return EquationsOfMotion(
        coordinates=tuple(c.symbol for c in free),
        velocities=tuple(c.rate for c in free),
        mass=mass,
        terms=tuple(map(tuple, terms)),
        dimensions=("x",) if one else tuple(size_of(c.name) for c in free),
        rate_dimensions=("x time^-1",) if one else tuple(size_of(c.rate.name) for c in free),
    )


def measured_before(shown: Sequence[sp.Expr], delay: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
    """Return value and rate of a measured motion before a delay, by a Taylor series that is valid for small delays."""
    value, rate, curvature = shown
    return value + delay * rate + delay**2 / 2 * curvature, rate + delay * curvature


def observer_acceleration(
    free: Sequence[Coordinate],
    reads: sp.Expr,
    shown: tuple[sp.Expr, sp.Expr],
    measured: tuple[sp.Expr, sp.Expr],
    bandwidth: sp.Expr,
) -> sp.Matrix:
    """Return the accelerations of the free coordinates with which the error of one sensor decays, shape (n_degrees, 1)."""
    slopes = sp.Matrix([derivative(reads, c.rate) for c in free])
    if any(slope != 0 for slope in slopes):
        wanted = bandwidth * (measured[0] - shown[0])
    else:
        slopes = sp.Matrix([derivative(reads, c.symbol) for c in free])
        wanted = bandwidth**2 * (measured[0] - shown[0]) + sp.sqrt(2) * bandwidth * (measured[1] - shown[1])
    return slopes * (wanted / slopes.dot(slopes))
