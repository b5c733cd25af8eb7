"""The equations of a rig without effects as numerical functions: rates, readings and forces for arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import sympy as sp

from rigsight.effects.placed import ByIdentity
from rigsight.effects.symbols import derivative
from rigsight.records.record import Floats, Record
from rigsight.rigs import Joint, Rig, applied_symbol
from rigsight.simulate import compose, parameter_vector, record_input, record_values
from rigsight.simulate.equations.derivatives import slopes_of
from rigsight.simulate.equations.signal_path import bound_to
from rigsight.simulate.equations.straight_line import StraightLine, of_parts, straight_line
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.equations.tree import Output
from rigsight.simulate.input_hold import HeldInput

FUNCTIONS = {"positive_part": lambda x: np.maximum(x, 0.0)}
"""Functions in the equations of effects and rigs that numpy does not have under these names."""


def equations_of(rig: Rig) -> RigEquations:
    """Return the equations of a rig as functions; repeated calls return the same object."""
    return _equations_of(ByIdentity(rig))


# Generating them takes a tenth of a second, and every fit needs them.
@lru_cache(maxsize=32)
def _equations_of(key: ByIdentity[Rig]) -> RigEquations:
    return RigEquations(key.value)


class RigEquations:
    """The equations of a rig without effects.

    All functions take the states ``z`` of shape (n_states, n_samples): coordinates first, then their rates, then the rig's
    own states; the inputs ``u`` of shape (3 n_inputs, n_samples) (each with its first and second time derivative) and the
    parameter vector ``p`` of `structure`, shape (n_parameters,). `structure` has an additional sensor for each state, so that
    one simulation returns all of them.
    """

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        mechanism = rig.mechanism
        free = mechanism.free
        own = [*(c.symbol for c in free), *(c.rate for c in free), *(s.symbol for s in mechanism.states)]
        alone = compose(rig)
        shown = tuple(Output(f"state {symbol.name}", (symbol,)) for symbol in own)
        self.structure = replace(alone, tree=replace(alone.tree, outputs=(*alone.tree.outputs, *shown)))
        self.n_coordinates = len(free)
        self.inputs = [s for i in range(len(rig.inputs)) for s in input_symbols(i)]
        """Symbols of the inputs, each with its first and second time derivative."""
        self.sensor_names = tuple(sensor.name for sensor in mechanism.sensors)
        self.state_names = tuple(symbol.name for symbol in own)
        self._functions: dict[str, Any] = {}

    @property
    def n_states(self) -> int:
        """Number of coordinates, rates and own states."""
        return len(self.structure.states)

    def parameters(self, values: Mapping[str, float], record: Record) -> Floats:
        """Return the parameter vector from values by name, with the record's own constants and defaults for missing values."""
        return parameter_vector(self.structure, record_values(self.structure, values, record))

    def shows_all_states(self, measured: set[str]) -> bool:
        """Return True if these sensors alone give all coordinates and own states, independent of the parameters."""
        coordinates = [c.symbol for c in self.rig.mechanism.free]
        own = [state.symbol for state in self.rig.mechanism.states]
        # Rates of coordinates follow from the slopes of readings; those of own states depend on the parameters.
        return self._show(measured, coordinates) and self._show(measured, [*coordinates, *own])

    def _show(self, measured: set[str], wanted: Sequence[sp.Symbol]) -> bool:
        read = [
            sensor.reads
            for sensor in self.rig.mechanism.sensors
            if sensor.name in measured and sensor.reads.free_symbols <= set(wanted)
        ]
        slopes = sp.Matrix(len(read), len(wanted), [derivative(e, s) for e in read for s in wanted])
        return bool(slopes.is_symbolic() is False and slopes.rank() == len(wanted))

    @cached_property
    def of_coordinates(self) -> frozenset[str]:
        """Sensors whose slope does not depend on the parameters: neither that of a rate does, nor that of an own state."""
        mechanism = self.rig.mechanism
        others = {*(c.rate for c in mechanism.free), *(state.symbol for state in mechanism.states)}
        return frozenset(s.name for s in mechanism.sensors if not s.reads.free_symbols & others)

    def inputs_of(self, record: Record) -> tuple[HeldInput, Floats]:
        """Return a record's inputs between samples, and at them with their derivatives, shape (3 n_inputs, n_samples)."""
        held = record_input(self.structure, record)
        return held, held.at_samples(record.n_samples)[: 3 * len(self.rig.inputs)]

    def accelerations(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the second derivatives of the coordinates, shape (n_coordinates, n_samples)."""
        n = self.n_coordinates
        if n == 0:
            return np.zeros((0, z.shape[1]))
        mass = self.mass(z, u, p)
        forces = np.moveaxis(self._values("forces", z, u, p), 0, 1)
        with np.errstate(all="ignore"):
            solved = np.linalg.solve(mass, forces[:, :, None])
        return np.asarray(solved[:, :, 0].T, dtype=np.float64)

    def mass(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the mass matrix, shape (n_samples, n_coordinates, n_coordinates)."""
        n = self.n_coordinates
        return np.moveaxis(self._values("mass", z, u, p).reshape(n, n, z.shape[1]), 2, 0)

    def rates(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the time derivatives of the states, shape (n_states, n_samples)."""
        n = self.n_coordinates
        own = self._values("own rates", z, u, p)
        return np.concatenate([z[n : 2 * n], self.accelerations(z, u, p), own])

    def readings(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the readings of the rig's sensors, shape (n_sensors, n_samples)."""
        return self._values("readings", z, u, p)

    def reading_slopes(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the time derivatives of the readings, shape (n_sensors, n_samples)."""
        by_input = self._values("by input", z, u, p).reshape(len(self.sensor_names), *u.shape)
        own = np.einsum("ijk,jk->ik", self.readings_by_state(z, u, p), self.rates(z, u, p))
        # The third derivative of an input is unknown.
        rising = np.zeros_like(u)
        rising[0::3], rising[1::3] = u[1::3], u[2::3]
        return np.asarray(own + np.einsum("ijk,jk->ik", by_input, rising))

    def readings_by_state(self, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the derivatives of the readings by the states, shape (n_sensors, n_states, n_samples)."""
        return self._values("by state", z, u, p).reshape(len(self.sensor_names), self.n_states, z.shape[1])

    def at_places(self, z: Floats, u: Floats, p: Floats) -> dict[str, Floats]:
        """Return motion and forces of joints and drives, shape (n_samples,) each."""
        # ``motion@J`` (from rest), ``rate@J``, ``spring@J``, ``damper@J``, ``own@J`` (other resisting forces) of a joint,
        # ``signal@D`` and ``force@D`` of a drive, ``error@D`` and ``command@D`` of its controller.
        return dict(zip(self._of_places, self._values("of places", z, u, p), strict=True))

    def slopes_along(self, z: Floats, u: Floats, p: Floats) -> dict[str, Floats]:
        """Return the derivatives of the motion of each joint and of each drive by the degrees of freedom."""
        # Shape (n_coordinates, n_samples) each.
        mechanism = self.rig.mechanism
        places = [*(joint.name for joint in mechanism.joints), *(drive.name for drive in mechanism.drives)]
        rows = np.reshape(self._values("along", z, u, p), (len(places), self.n_coordinates, z.shape[1]))
        return dict(zip(places, rows, strict=True))

    def changes_of_equations(
        self, z: Floats, u: Floats, p: Floats, accelerations: Floats
    ) -> tuple[Floats, Floats]:
        """Return the size of the largest part of each equation, and the derivatives of the equations by the parameters."""
        # The equations are those of motion (as forces), of the own states (as rates) and of the sensors.
        parts, slopes, ends = self._of_parameters
        arguments = [*z, *u, 0.0, *p, *accelerations]
        rows = rows_of(parts(*arguments), z.shape[1])
        largest = [
            np.max(np.abs(rows[first:last]), axis=0)
            for first, last in zip([0, *ends[:-1]], ends, strict=True)
        ]
        by_parameter = rows_of(slopes(*arguments), z.shape[1])
        return np.array(largest), by_parameter.reshape(len(ends), p.size, z.shape[1])

    def _values(self, what: str, z: Floats, u: Floats, p: Floats) -> Floats:
        """Return the values of some expressions; their function is made when it is first needed."""
        if what not in self._functions:
            self._functions[what] = self._function(self._expressions(what))
        with np.errstate(all="ignore"):
            return rows_of(self._functions[what](*z, *u, 0.0, *p), z.shape[1])

    def _expressions(self, what: str) -> list[sp.Expr]:
        tree, mechanism = self.structure.tree, self.rig.mechanism
        moved = [*(joint.motion for joint in mechanism.joints), *(drive.along for drive in mechanism.drives)]

        def slopes(of: Sequence[sp.Expr], by: Sequence[sp.Symbol]) -> list[sp.Expr]:
            return [derivative(expression, symbol) for expression in of for symbol in by]

        expressions: dict[str, Callable[[], list[sp.Expr]]] = {
            "mass": lambda: self.mass_entries,
            "forces": lambda: self.forces,
            "own rates": lambda: [tree.flattened(state.rate) for state in tree.states],
            "readings": lambda: self._sensor_expressions,
            "by state": lambda: slopes(self._sensor_expressions, self.structure.states),
            "by input": lambda: slopes(self._sensor_expressions, self.inputs),
            "of places": lambda: self._bound(list(self._of_places.values())),
            "along": lambda: self._bound(slopes(moved, [c.symbol for c in mechanism.free])),
        }
        return expressions[what]()

    @cached_property
    def arguments(self) -> list[sp.Symbol]:
        """Symbols of states, inputs with their derivatives, time and parameters, in the order of the functions' arguments."""
        return [*self.structure.states, *self.inputs, TIME, *self.structure.parameter_symbols]

    @cached_property
    def momenta_and_forces(self) -> tuple[list[sp.Expr], list[sp.Expr]]:
        """Momentum and force (``d/dt momentum = force``) of each coordinate; for each own state, the state and its rate."""
        mechanism = self.rig.mechanism
        momenta, of_bodies = mechanism.momenta_and_forces
        applied = []
        for c in mechanism.free:
            force = sp.S.Zero
            for drive in mechanism.drives:
                force += derivative(drive.along, c.symbol) * drive.force
            for joint in mechanism.joints:
                force -= derivative(joint.motion, c.symbol) * sum(
                    _resisting(joint, self.rig), start=sp.S.Zero
                )
            applied.append(force)
        on_bodies = {applied_symbol(i): force for i, force in enumerate(applied)}
        forces = [force + own.xreplace(on_bodies) for force, own in zip(applied, of_bodies, strict=True)]
        states = [state.symbol for state in mechanism.states]
        rates = [state.rate for state in mechanism.states]
        return self._bound([*momenta, *states]), self._bound([*forces, *rates])

    def _function(self, expressions: list[sp.Expr], *further: sp.Symbol) -> Any:
        arguments, modules = [*self.arguments, *further], [FUNCTIONS, "numpy"]
        if self.structure.elimination is not None:
            return straight_line(expressions, self.structure.steps).function(arguments, modules)
        return sp.lambdify(arguments, expressions, modules=modules, cse=True)

    @property
    def mass_entries(self) -> list[sp.Expr]:
        """The mass matrix row by row; for a large rig the symbols of `Structure.steps`."""
        tree, elimination = self.structure.tree, self.structure.elimination
        if elimination is not None:
            return elimination.entries
        return [tree.flattened(entry) for entry in tree.motion.mass]

    @property
    def forces(self) -> list[sp.Expr]:
        """The generalized forces; for a large rig the symbols of `Structure.steps`."""
        tree, elimination = self.structure.tree, self.structure.elimination
        if elimination is not None:
            return list(elimination.loads)
        return [tree.flattened(force) for force in tree.motion.forces]

    def slopes(
        self,
        expressions: Sequence[sp.Expr],
        by: Sequence[sp.Symbol],
        further: Sequence[sp.Symbol] = (),
        beside: Sequence[sp.Expr] = (),
    ) -> Any:
        """Return a function for the derivatives of expressions, expression by expression."""
        elimination = self.structure.elimination
        if elimination is None:
            return self._function([*beside, *(derivative(e, s) for e in expressions for s in by)], *further)
        line = straight_line([*beside, *expressions], elimination.begun(self.structure.steps))
        changes = slopes_of(StraightLine(line.parts, line.results[len(beside) :]), by)
        results = (*line.results[: len(beside)], *changes.results)
        both = of_parts({**line.parts, **changes.parts}, results)
        return both.function([*self.arguments, *further], [FUNCTIONS, "numpy"])

    @cached_property
    def _sensor_expressions(self) -> list[sp.Expr]:
        return list(self.structure.outputs[: len(self.sensor_names)])

    @cached_property
    def _of_places(self) -> dict[str, sp.Expr]:
        mechanism = self.rig.mechanism
        wanted: dict[str, sp.Expr] = {}
        for joint in mechanism.joints:
            motions = {"motion": joint.motion - joint.rest, "rate": mechanism.rate(joint.motion)}
            forces = dict(zip(("spring", "damper", "own"), _resisting(joint, self.rig), strict=True))
            wanted |= {f"{what}@{joint.name}": own for what, own in {**motions, **forces}.items()}
        for drive in mechanism.drives:
            wanted |= {f"signal@{drive.name}": drive.signal, f"force@{drive.name}": drive.force}
        for name, law in self.rig.controllers.items():
            wanted |= {f"error@{name}": law.error, f"command@{name}": law.command}
        return wanted

    def _bound(self, expressions: list[sp.Expr]) -> list[sp.Expr]:
        structure = self.structure
        symbols = dict(zip(structure.names, structure.parameter_symbols, strict=True))
        return list(bound_to(self.rig, symbols, expressions))

    @cached_property
    def _of_parameters(self) -> tuple[Any, Any, list[int]]:
        tree, names = self.structure.tree, self.rig.mechanism.free
        motion = tree.motion
        accelerations = [sp.Symbol(f"acceleration {c.name}", real=True) for c in names]
        n, mass, forces = self.n_coordinates, self.mass_entries, self.forces
        parts: list[list[sp.Expr]] = []
        sums: list[sp.Expr] = []
        for i, terms in enumerate(motion.terms):
            inertial = [mass[i * n + j] * a for j, a in enumerate(accelerations)]
            parts.append([*inertial, *(tree.flattened(-term) for term in terms)])
            sums.append(sp.Add(*inertial, -forces[i]))
        others = [[tree.flattened(term) for term in state.terms] for state in tree.states]
        others += [list(sp.Add.make_args(e)) for e in self._sensor_expressions]
        parts += others
        if self.structure.elimination is None:
            sums = [sp.Add(*own) for own in parts[:n]]
        sums += [sp.Add(*own) for own in others]
        slopes = self.slopes(sums, self.structure.parameter_symbols, accelerations)
        # An equation of motion may have no force at all.
        parts = [own or [sp.S.Zero] for own in parts]
        ends = list(np.cumsum([len(own) for own in parts]))
        together = self._function([part for own in parts for part in own], *accelerations)
        return together, slopes, [int(end) for end in ends]


def _resisting(joint: Joint, rig: Rig) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """Return the forces that resist the motion of a joint: spring, damper, and its own force."""
    spring = joint.stiffness * (joint.motion - joint.rest)
    return spring, joint.damping * rig.mechanism.rate(joint.motion), joint.force


def rows_of(values: Any, n_samples: int) -> Floats:
    """Return the results of a function of arrays, shape (n_rows, n_samples); some of them may be constant."""
    found = np.empty((len(values), n_samples))
    for row, value in zip(found, values, strict=True):
        row[:] = value
    return found
