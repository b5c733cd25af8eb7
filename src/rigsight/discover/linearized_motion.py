"""Sensitivity of the motion and readings of a structure to small changes of state and parameters along a record.

The equations are flattened once into functions of arrays. From sample to sample they are integrated together with their
derivatives (Runge-Kutta of fourth order), starting anew at each sample of a reference motion: errors do not grow if a rig is
unstable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.identify.rig_equations import FUNCTIONS, rows_of
from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure, parameter_vector, record_input
from rigsight.simulate.equations.derivatives import slope, slopes_of
from rigsight.simulate.equations.elimination import Elimination
from rigsight.simulate.equations.straight_line import straight_line
from rigsight.simulate.equations.structure import TIME, input_symbols
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.simulation import record_values

_LONGEST_STEP = 0.5
"""Integration step times the fastest rate of the linearized equations; this is well within the stability limit of the method."""
_MOST_STEPS = 32
"""Largest number of steps per piece of the input; a state too stiff for it is assumed to follow without delay."""
_LOOKED_AT = 25
"""Number of samples of a record at which the fastest rate is computed."""


@dataclass(frozen=True, eq=False)
class LinearizedMotion:
    """A record about a reference motion: ``x[k+1] = reference[k+1] + defect[k] + transition[k] @ (x[k] - reference[k])...``."""

    reference: Floats  # states, shape (n_samples, n_states)
    transition: Floats  # derivative of the next state by this one, shape (n_samples - 1, n_states, n_states)
    # Derivative of the next state by parameters, shape (n_samples - 1, n_states, n_parameters).
    by_parameter: Floats
    # State simulated one sample ahead from a reference state, minus the next reference state, shape (n_samples - 1, n_states).
    defect: Floats
    seen: Floats  # derivative of the readings by the state, shape (n_samples, n_outputs, n_states)
    # Derivative of the readings by parameters, shape (n_samples, n_outputs, n_parameters).
    seen_by_parameter: Floats
    # Measured minus the readings of the reference, shape (n_samples, n_outputs); NaN where nothing was measured.
    residual: Floats
    dt: float  # sample time [s]


class MotionEquations:
    """The equations of a structure as functions of arrays, with derivatives by some of its parameters."""

    def __init__(self, structure: Structure, fitted: Sequence[str]) -> None:
        self.structure = structure
        self.fitted = tuple(fitted)
        tree, states = structure.tree, structure.states
        motion = tree.motion
        self._n = len(motion.coordinates)
        self._n_states, self._n_outputs = len(states), len(structure.outputs)
        n_inputs = len(structure.rig.mechanism.inputs)
        inputs = [symbol for index in range(n_inputs) for symbol in input_symbols(index)]
        self._arguments = arguments = [*states, *inputs, TIME, *structure.parameter_symbols]
        others = [equation.limited_rate for equation in structure.equations[2 * self._n :]]
        readings = list(structure.outputs)
        by_name = dict(zip(structure.names, structure.parameter_symbols, strict=True))
        directions = [*states, *(by_name[name] for name in self.fitted)]
        if structure.elimination is not None:
            self._values, self._slopes = _in_parts(
                structure, structure.elimination, [*others, *readings], arguments, directions
            )
            return
        accelerations = [sp.Symbol(f"acceleration_{i}", real=True) for i in range(self._n)]
        mass = [tree.flattened(entry) for entry in motion.mass]
        forces = [tree.flattened(force) for force in motion.forces]
        # The mass matrix is inverted numerically: the symbolic inverse for a robot fills pages.
        balance = [
            force - sum((mass[i * self._n + j] * accelerations[j] for j in range(self._n)), start=sp.S.Zero)
            for i, force in enumerate(forces)
        ]
        slopes = [slope(e, s) for e in (*balance, *others, *readings) for s in directions]
        self._values = _compiled(arguments, [*mass, *forces, *others, *readings])
        self._slopes = _compiled([*arguments, *accelerations], slopes)

    def about(self, record: Record, values: Mapping[str, float], reference: Floats) -> LinearizedMotion:
        """Linearize about a reference motion."""
        p = parameter_vector(self.structure, record_values(self.structure, values, record))
        held = record_input(self.structure, record)
        x, u, times = self._at_samples(record, held, reference)
        readings, seen = self._readings(x, u, times, p)
        names = [signal.name for signal in self.structure.rig.outputs]
        missing = np.full(record.n_samples, np.nan)
        measured = np.column_stack([record.signals.get(name, missing) for name in names])
        after, changes = self._stepped(x[:, :-1], held, record, p)
        n = self._n_states
        return LinearizedMotion(
            reference=reference,
            transition=changes[:, :, :n],
            by_parameter=changes[:, :, n:],
            defect=after.T - reference[1:],
            seen=seen[:, :, :n],
            seen_by_parameter=seen[:, :, n:],
            residual=measured - readings.T,
            dt=record.dt,
        )

    def along(
        self, expressions: Sequence[sp.Expr], record: Record, values: Mapping[str, float], reference: Floats
    ) -> Floats:
        """Return expressions of the structure's symbols along a motion, shape (n_expressions, n_samples)."""
        x, u, times = self._at_samples(record, record_input(self.structure, record), reference)
        p = parameter_vector(self.structure, record_values(self.structure, values, record))
        return _evaluated(_compiled(self._arguments, expressions), (*x, *u, times, *p), record.n_samples)

    def _at_samples(
        self, record: Record, held: HeldInput, reference: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Return states, inputs and times at the samples."""
        u = held.at_samples(record.n_samples)[: 3 * len(self.structure.rig.inputs)]
        times = np.asarray(record.dt * np.arange(record.n_samples), dtype=np.float64)
        return np.ascontiguousarray(reference.T), u, times

    def _inputs(self, held: HeldInput, pieces: NDArray[np.int_], tau: Floats) -> Floats:
        """Return inputs with their derivatives within pieces, shape (3 n_inputs, n); empty for a rig without inputs."""
        return _input_at(held, pieces, tau)[: 3 * len(self.structure.rig.inputs)]

    def _stepped(self, x: Floats, held: HeldInput, record: Record, p: Floats) -> tuple[Floats, Floats]:
        """Return the state one sample later, shape (n_states, n), and its slopes, shape (n, n_states, n_states + n_fitted)."""
        count = x.shape[1]
        first = held.per_sample * np.arange(count)
        steps = self._steps(x, self._inputs(held, first, np.zeros(count)), p, held.interval)
        h = held.interval / steps
        n, m = self._n_states, self._n_states + len(self.fitted)
        change = np.zeros((count, n, m))
        change[:, :, :n] = np.eye(n)
        start = np.asarray(record.dt * np.arange(count), dtype=np.float64)
        for piece in range(held.per_sample):
            for step in range(steps):
                stages = [self._stage(x, change, held, first + piece, start, step * h, p)]
                for share in (0.5, 0.5, 1.0):
                    rate, growth = stages[-1]
                    moved, changed = x + share * h * rate, change + share * h * growth
                    tau = (step + share) * h
                    stages.append(self._stage(moved, changed, held, first + piece, start, tau, p))
                for weight, (rate, growth) in zip((1.0, 2.0, 2.0, 1.0), stages, strict=True):
                    x = x + weight * h / 6.0 * rate
                    change = change + weight * h / 6.0 * growth
            start = start + held.interval
        return x, change

    def _stage(
        self,
        x: Floats,
        change: Floats,
        held: HeldInput,
        pieces: NDArray[np.int_],
        start: Floats,
        tau: float,
        p: Floats,
    ) -> tuple[Floats, Floats]:
        """Return the rates of states and of their derivatives within pieces of the input."""
        n = self._n_states
        u = self._inputs(held, pieces, np.full(pieces.size, tau))
        rates, slopes = self._rates(x, u, start + tau, p)
        growth = slopes[:, :, :n] @ change
        growth[:, :, n:] += slopes[:, :, n:]
        return rates, growth

    def _steps(self, x: Floats, u: Floats, p: Floats, interval: float) -> int:
        some = np.unique(np.linspace(0, x.shape[1] - 1, _LOOKED_AT).astype(int))
        _, a = self._rates(x[:, some], u[:, some], np.zeros(some.size), p)
        fastest = float(np.max(np.abs(np.linalg.eigvals(a[:, :, : self._n_states]))))
        return int(np.clip(np.ceil(interval * fastest / _LONGEST_STEP), 1, _MOST_STEPS))

    def _rates(self, x: Floats, u: Floats, t: Floats, p: Floats) -> tuple[Floats, Floats]:
        """Return the rates, shape (n_states, n), and their derivatives, shape (n, n_states, n_states + n_fitted)."""
        n, count = self._n, x.shape[1]
        accelerations, mass, values = self._accelerations(x, u, t, p)
        rates = np.vstack([x[n : 2 * n], accelerations, values[n * n + n : n * n + self._n_states - n]])
        slopes = self._slopes_at(x, u, t, p, accelerations)
        full = np.zeros((count, self._n_states, slopes.shape[2]))
        full[:, np.arange(n), n + np.arange(n)] = 1.0
        if n:
            full[:, n : 2 * n] = np.linalg.solve(mass, slopes[:, :n])
        full[:, 2 * n :] = slopes[:, n : self._n_states - n]
        return rates, full

    def _readings(self, x: Floats, u: Floats, t: Floats, p: Floats) -> tuple[Floats, Floats]:
        accelerations, _, values = self._accelerations(x, u, t, p)
        slopes = self._slopes_at(x, u, t, p, accelerations)
        return values[-self._n_outputs :], slopes[:, -self._n_outputs :]

    def _accelerations(self, x: Floats, u: Floats, t: Floats, p: Floats) -> tuple[Floats, Floats, Floats]:
        n = self._n
        values = _evaluated(self._values, (*x, *u, t, *p), x.shape[1])
        mass = np.moveaxis(values[: n * n].reshape(n, n, x.shape[1]), 2, 0)
        forces = values[n * n : n * n + n].T
        solved = np.linalg.solve(mass, forces[:, :, None])[:, :, 0] if n else forces
        return np.ascontiguousarray(solved.T), mass, values

    def _slopes_at(self, x: Floats, u: Floats, t: Floats, p: Floats, accelerations: Floats) -> Floats:
        values = _evaluated(self._slopes, (*x, *u, t, *p, *accelerations), x.shape[1])
        n_directions = self._n_states + len(self.fitted)
        return np.moveaxis(values.reshape(-1, n_directions, x.shape[1]), 2, 0)


def _in_parts(
    structure: Structure,
    elimination: Elimination,
    others: Sequence[sp.Expr],
    arguments: Sequence[sp.Symbol],
    directions: Sequence[sp.Symbol],
) -> tuple[Any, Any]:
    """Return functions for long equations of motion: masses, forces and other values; slopes of the residual of the balance."""
    begun = elimination.begun(structure.steps)
    values = straight_line([*elimination.entries, *elimination.loads, *others], begun)
    slopes = slopes_of(straight_line([*elimination.left, *others], begun), directions)
    modules = [FUNCTIONS, "numpy"]
    return values.function(arguments, modules), slopes.function(
        [*arguments, *elimination.accelerations], modules
    )


def _compiled(arguments: Sequence[sp.Symbol], expressions: Sequence[sp.Expr]) -> Any:
    # Names of states contain points and parentheses.
    plain = {symbol: sp.Symbol(f"a{i}", real=True) for i, symbol in enumerate(arguments)}
    written = [sp.sympify(expression).xreplace(plain) for expression in expressions]
    return sp.lambdify(list(plain.values()), written, [FUNCTIONS, "numpy"], cse=True)


def _evaluated(function: Any, arguments: Sequence[Any], count: int) -> Floats:
    with np.errstate(all="ignore"):
        return rows_of(function(*arguments), count)


def _input_at(held: HeldInput, pieces: NDArray[np.int_], tau: Floats) -> Floats:
    """Return every input with its first two derivatives, shape (3 n_inputs, n)."""
    coefficients = held.coefficients.reshape(held.n_pieces + 1, -1, 4)
    c0, c1, c2, c3 = np.moveaxis(coefficients[1 + pieces], 2, 0)
    s = tau[:, None]
    value = c0 + s * (c1 + s * (c2 + s * c3))
    rate, curvature = c1 + s * (2.0 * c2 + 3.0 * s * c3), 2.0 * c2 + 6.0 * s * c3
    return np.stack([value, rate, curvature], axis=2).reshape(tau.size, -1).T
