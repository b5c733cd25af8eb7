"""Which equations of motion follow from a rig's coordinates, energies and other parts?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice, permutations, product

import numpy as np
import sympy as sp
from sympy.simplify.fu import TR8

from rigsight.effects.symbols import derivative, rate_along
from rigsight.parameters import Parameter
from rigsight.rigs.parts import (
    Coordinate,
    Drive,
    Joint,
    RateState,
    Sensor,
    acceleration,
    applied_symbol,
    force_symbol,
)
from rigsight.simulators import Bodies, force_leaf, mass_leaf

_LONGEST_SHORTENED = 100
"""In operations. Simplification takes a millisecond for each, and longer expressions are not read."""


@dataclass(frozen=True)
class Mechanism:
    """The equations of a rig without effects, as declared."""

    inputs: tuple[str, ...]  # names of the recorded signals that drive it
    # Degrees of freedom and energies.
    coordinates: tuple[Coordinate, ...]
    kinetic: sp.Expr
    potential: sp.Expr
    # What acts on the motion, and what reads it.
    joints: tuple[Joint, ...]
    drives: tuple[Drive, ...]
    sensors: tuple[Sensor, ...]
    states: tuple[RateState, ...] = ()
    # Named values in an order in which each reads only those in front of it; drives and sensors are read by
    # their names.
    signals: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    # Start values of coordinates, rates and states by symbol, where they are not those of rest.
    initial: Mapping[sp.Symbol, sp.Expr] = field(default_factory=dict)
    order: tuple[str, ...] = ()  # names of drives and sensors in an order in which none reads one behind it
    # What another program simulates; its mass matrix and forces are added to those of the energies.
    bodies: Bodies | None = None
    # Parameters, constants and states that the bodies read, in the order of theirs.
    asked: tuple[sp.Symbol, ...] = ()

    @property
    def free(self) -> tuple[Coordinate, ...]:
        """The degrees of freedom."""
        return tuple(c for c in self.coordinates if c.prescribed_by is None)

    @property
    def prescribed(self) -> tuple[Coordinate, ...]:
        """The coordinates whose motion an input prescribes."""
        return tuple(c for c in self.coordinates if c.prescribed_by is not None)

    @property
    def prescribing(self) -> frozenset[str]:
        """Names of the inputs that prescribe a motion."""
        return frozenset(c.prescribed_by for c in self.coordinates if c.prescribed_by is not None)

    @property
    def first_joint(self) -> Joint:
        """The joint that effects at drives and sensors read; without joints, the first motion, if any, which nothing resists."""
        if self.joints:
            return self.joints[0]
        return Joint("", self.coordinates[0].symbol if self.coordinates else sp.Integer(0))

    def joint_named(self, name: str | None) -> Joint:
        """Return a joint by its name; the first one for any other name."""
        return next((joint for joint in self.joints if joint.name == name), self.first_joint)

    @property
    def moving(self) -> set[sp.Symbol]:
        """Coordinates, rates and states, and the named signals, which may hold these."""
        own = {symbol for c in self.coordinates for symbol in (c.symbol, c.rate)}
        return own | {state.symbol for state in self.states} | set(self.signals)

    @cached_property
    def has_one_motion(self) -> bool:
        """True for one joint along the one coordinate, moved by one input or following it, without feedback."""
        # Then ``inertia * x'' = gain * u + bias - stiffness * (x - rest) - damping * x'`` says it all, or, of a
        # prescribed motion, what its joint resists with.
        if not len(self.coordinates) == len(self.joints) == len(self.inputs) == 1 or self.potential != 0:
            return False
        (coordinate,), (joint,) = self.coordinates, self.joints
        moving = {coordinate.symbol, coordinate.rate, *(state.symbol for state in self.states)}
        if joint.motion != coordinate.symbol or (joint.force.free_symbols & moving) or not self.sensors:
            return False
        if not self.free:
            return not self.drives and self.sensors[0].reads == force_symbol(joint.name)
        return (
            len(self.drives) == 1
            and self._is_plain(self.drives[0])
            and self.drives[0].along == coordinate.symbol
            and self.sensors[0].reads == coordinate.symbol
            and not self.mass_matrix.free_symbols & moving
        )

    def _is_plain(self, drive: Drive) -> bool:
        """Return True for a drive whose force is an input times a constant gain."""
        own = sp.Symbol(drive.name, real=True)
        gain = derivative(drive.force, own)
        read = gain.free_symbols | {own, *drive.signal.free_symbols}
        is_gain = own not in gain.free_symbols and sp.expand(drive.force - gain * own) == 0
        return is_gain and drive.signal == sp.Symbol(self.inputs[0], real=True) and not read & self.moving

    @cached_property
    def mass_matrix(self) -> sp.ImmutableMatrix:
        """``d^2 T / d q' d q'`` of the degrees of freedom, shape (n, n)."""
        rates, momenta = [c.rate for c in self.free], self._momenta
        entries = {
            (i, j): _shortened(derivative(momenta[i], rates[j])) + self._simulated_mass(i, j)
            for i in range(len(rates))
            for j in range(i + 1)
        }
        return sp.ImmutableMatrix(len(rates), len(rates), lambda i, j: entries[max(i, j), min(i, j)])

    def _simulated_mass(self, i: int, j: int) -> sp.Expr:
        if self.bodies is None:
            return sp.S.Zero
        return mass_leaf(self.bodies, i, j, [c.symbol for c in self.free], self.asked)

    @cached_property
    def simulated_forces(self) -> tuple[sp.Expr, ...]:
        """What another program puts on each degree of freedom; the forces of drives and joints are `applied_symbol`."""
        if self.bodies is None:
            return tuple(sp.S.Zero for _ in self.free)
        q, v = [c.symbol for c in self.free], [c.rate for c in self.free]
        f = [applied_symbol(i) for i in range(len(q))]
        return tuple(force_leaf(self.bodies, i, q, v, f, self.asked) for i in range(len(q)))

    @cached_property
    def bodies_are_nonlinear(self) -> bool:
        """True where bodies that another program simulates read parameters or states of the rig, or the forces on them."""
        # Its equations are no sums of terms then, each of one parameter.
        return self.bodies is not None and (bool(self.asked) or self.bodies.program.reads_forces)

    @cached_property
    def momenta_and_forces(self) -> tuple[tuple[sp.Expr, ...], tuple[sp.Expr, ...]]:
        """Momentum of each degree of freedom, and its rate without drives and joints."""
        momenta, forces, rates = [], [], [c.rate for c in self.free]
        for i, (own, momentum) in enumerate(zip(self.free, self._momenta, strict=True)):
            force = derivative(self.kinetic - self.potential, own.symbol) + self.simulated_forces[i]
            row = [self._simulated_mass(i, j) for j in range(len(rates))]
            momenta.append(momentum + sp.Add(*(mass * rate for mass, rate in zip(row, rates, strict=True))))
            # The mass matrix turns with the motion: d(M v) / dt = M a + dM/dt v.
            turned = [self.rate(mass) * rate for mass, rate in zip(row, rates, strict=True)]
            forces.append(force + sp.Add(*turned))
        return tuple(momenta), tuple(forces)

    @cached_property
    def _momenta(self) -> tuple[sp.Expr, ...]:
        return tuple(derivative(self.kinetic, c.rate) for c in self.free)

    @cached_property
    def generalized_forces(self) -> tuple[sp.Expr, ...]:
        """What the energies contribute to ``mass_matrix @ q'' = ...``, one for each degree of freedom."""
        # By Lagrange's equations ``d/dt dT/dq' - dT/dq + dV/dq = Q``, the part with the accelerations on the other side. The
        # acceleration of a prescribed coordinate is the symbol ``dd(NAME)``.
        forces = []
        for coordinate, momentum in zip(self.free, self._momenta, strict=True):
            lagrangian = derivative(self.kinetic - self.potential, coordinate.symbol)
            forces.append(_shortened(lagrangian - self._along_motion(momentum)))
        return tuple(forces)

    def _along_motion(self, expression: sp.Expr) -> sp.Expr:
        """Return the time derivative of an expression while the rates of the degrees of freedom stay as they are."""
        # One derivative along the motion: one for each coordinate takes many times as long on an arm of six joints.
        ahead = sp.Symbol("time ahead", real=True)
        moved = {c.symbol: c.symbol + ahead * c.rate for c in self.coordinates}
        moved |= {c.rate: c.rate + ahead * acceleration(c) for c in self.prescribed}
        return derivative(expression.xreplace(moved), ahead).xreplace({ahead: sp.Integer(0)})

    def rate(self, expression: sp.Expr) -> sp.Expr:
        """Return the time derivative of an expression of the coordinates and states."""
        rates = {c.symbol: c.rate for c in self.coordinates} | {s.symbol: s.rate for s in self.states}
        return rate_along(expression, rates)

    def prescribed_rate(self, expression: sp.Expr) -> sp.Expr:
        """Return the time derivative of an expression of prescribed coordinates and their rates."""
        accelerations = {c.rate: acceleration(c) for c in self.prescribed}
        return self.rate(expression) + rate_along(expression, accelerations)

    def written_out(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression without named signals."""
        return without_signals(expression, self.signals)

    def carried_by(self, joint: Joint) -> sp.Expr:
        """Return what drives, weight and other joints' springs put on a joint: the push of drives less what the others do."""
        # Of a joint along one coordinate that is all that acts along this coordinate while nothing moves.
        return self.driven_by(joint) + self.resisted_by(joint)

    def driven_by(self, joint: Joint) -> sp.Expr:
        """Return the push of the drives on a joint; on one between several coordinates, of those along its own motion."""
        along = self._coordinates_of(joint)
        if len(along) == 1:
            (coordinate,) = along
            slope = derivative(joint.motion, coordinate.symbol)
            return sp.Add(*(derivative(d.along, coordinate.symbol) * d.force for d in self.drives)) / slope
        pushing = []
        for drive in self.drives:
            ratios = {derivative(drive.along, c.symbol) / derivative(joint.motion, c.symbol) for c in along}
            others = any(derivative(drive.along, c.symbol) != 0 for c in self.coordinates if c not in along)
            if len(ratios) == 1 and not others:
                pushing.append(ratios.pop() * drive.force)
        return sp.Add(*pushing)

    def resisted_by(self, joint: Joint) -> sp.Expr:
        """Return what weight and other joints' springs resist a joint with."""
        along = self._coordinates_of(joint)
        if len(along) != 1:
            return sp.S.Zero  # How weight is shared between joints of several coordinates no equation says.
        (coordinate,) = along
        at_rest = {c.rate: sp.Integer(0) for c in self.coordinates}
        springs = []
        for other in (own for own in self.joints if own is not joint):
            force = other.stiffness * (other.motion - other.rest) + other.force.xreplace(at_rest)
            springs.append(derivative(other.motion, coordinate.symbol) * force)
        weight = derivative(self.potential, coordinate.symbol)
        return sp.Add(weight, *springs) / derivative(joint.motion, coordinate.symbol)

    def _coordinates_of(self, joint: Joint) -> list[Coordinate]:
        return [c for c in self.coordinates if derivative(joint.motion, c.symbol) != 0]

    def moves_inertia(self, expression: sp.Expr) -> bool:
        """Return True if a force along an expression of the coordinates moves a degree of freedom."""
        return any(derivative(expression, c.symbol) != 0 for c in self.free)

    def has_known_inertia(self, expression: sp.Expr, parameters: Iterable[Parameter]) -> bool:
        """Return True if a part of the kinetic energy of an expression's coordinates has no parameter."""
        unknown = {sp.Symbol(p.name, real=True): sp.S.Zero for p in parameters}
        known = self.kinetic.xreplace(unknown)
        return not known.has(sp.zoo, sp.nan) and bool(
            known.free_symbols & {c.rate for c in self.free if derivative(expression, c.symbol) != 0}
        )

    @cached_property
    def has_short_inverse(self) -> bool:
        """Whether accelerations and inertias are formulas, see `has_short_inverse`."""
        return has_short_inverse(self.mass_matrix)

    def inertia_along(self, expression: sp.Expr) -> sp.Expr | None:
        """Return the inertia that a force along an expression of the coordinates moves; None where it moves nothing."""
        # ``1 / (J M^-1 J^T)`` with the slopes J of the expression: O. Khatib, IEEE J. Robot. Autom. 3 (1987) 43.
        slopes = sp.Matrix([[derivative(expression, c.symbol) for c in self.free]])
        if not self.moves_inertia(expression):
            return None
        mobility = (slopes * self.mass_matrix.LUsolve(slopes.T))[0, 0]
        return 1 / mobility

    def inertia_at(self, expression: sp.Expr, values: Mapping[str, float]) -> float | None:
        """Return the number of `inertia_along` where coordinates and parameters have values; None where it moves nothing."""
        if not self.moves_inertia(expression):
            return None
        slopes = [derivative(expression, c.symbol) for c in self.free]
        n, numbers = len(slopes), {sp.Symbol(name, real=True): value for name, value in values.items()}
        mass = np.array([float(entry.xreplace(numbers)) for entry in self.mass_matrix]).reshape(n, n)
        along = np.array([float(slope.xreplace(numbers)) for slope in slopes])
        return float(1.0 / (along @ np.linalg.solve(mass, along)))


def without_signals(expression: sp.Expr, signals: Mapping[sp.Symbol, sp.Expr]) -> sp.Expr:
    """Return an expression with the values of named signals, each of which reads only those in front of it."""
    for symbol, signal in reversed(list(signals.items())):
        expression = expression.xreplace({symbol: signal})
    return expression


def _shortened(expression: sp.Expr) -> sp.Expr:
    """Return an expression with products of sines and cosines as sums, if that is shorter: then what cancels is gone."""
    # R. G. Fu et al., Math. Comput. Model. 44 (2006) 748, rule TR8.
    # Counting the operations of an arm of six joints takes seconds; each has at most four nodes.
    nodes = islice(sp.preorder_traversal(expression), 4 * _LONGEST_SHORTENED, None)
    if any(True for _ in nodes) or sp.count_ops(expression) > _LONGEST_SHORTENED:
        return expression
    other = sp.expand(TR8(sp.expand(expression)))
    return min(expression, other, key=sp.count_ops)


_MOST_PRODUCTS = 20
"""Products of the determinant of coupled coordinates that are written as formulas. Accelerations hold as many, times those of the
forces. With 8 (two links by their moments) a compiler takes as long as for elimination, with 25 (the same by masses, lengths and
inertias) three times as long, at the same speed of the simulation."""
MOST_COUPLED = 3
"""Coordinates that move one another's inertia and whose accelerations are written as formulas. Those of four links in a plane
take a compiler minutes, those of three a second."""


def has_short_inverse(mass: sp.ImmutableMatrix) -> bool:
    """Return True if at most `MOST_COUPLED` coordinates move one another's inertia, directly or not, by short formulas."""
    return all(
        len(group) <= MOST_COUPLED and (len(group) == 1 or _products(mass, group) <= _MOST_PRODUCTS)
        for group in mass.connected_components()
    )


def _products(mass: sp.ImmutableMatrix, group: list[int]) -> int:
    """Return the products in the determinant of a group's rows, each entry written out as a sum."""
    terms = {place: len(sp.Add.make_args(mass[place])) for place in product(group, group) if mass[place] != 0}
    orders = (zip(group, order, strict=True) for order in permutations(group))
    return sum(math.prod(terms.get(place, 0) for place in places) for places in orders)
