"""Linearization of the equations of a rig at its equilibrium.

Derivatives are symbolic. Loops of control laws are closed in the equations, and so in the result. Dry friction is left out,
because its jump at rest has no slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.linalg import eigvals

from rigsight.errors import SimulationError
from rigsight.records.record import Floats
from rigsight.simulate.equations.derivatives import declared_start, slope_functions
from rigsight.simulate.equations.structure import TIME, Structure, input_symbols
from rigsight.simulate.equations.tree import FirstOrderState, Output, late
from rigsight.simulate.simulation import parameter_vector

Stability = Literal["stable", "drifts", "undamped", "unstable"]

_ROUNDED = 1e-7
"""Distance of two roots, over the largest pole, that may be rounding error: double roots are accurate to the root of 1e-16."""
_HIGHEST, _MOST_TURNS = 1e4, 20_000
"""Frequency over the quickest pole beyond which no loop answers, and points along the imaginary axis: 60 per turn of a delay up
to 300 turns."""
_VANISHES = 1e-10
"""Share of its parts below which a sum of products is rounding error."""


@dataclass(frozen=True, eq=False)
class LateSignals:
    """Delayed signals of a linearization: each is its signal v plus the change ``(e^(-s T) - 1) v``."""

    delays: Floats  # T [s], shape (n_late,)
    # Effect of the changes on z', y and v, shapes (n_states, n_late), (n_outputs, n_late) and (n_late,
    # n_late).
    on_states: Floats
    on_outputs: Floats
    on_signals: Floats
    from_states: Floats  # v by z, shape (n_late, n_states)
    from_inputs: Floats  # v by the inputs and their first and second derivatives, shape (3, n_late, n_inputs)


@dataclass(frozen=True, eq=False)
class Linearization:
    """``z' = A z + B u`` and ``y = C z + D u + D_1 u' + D_2 u''``, all as deviations from the equilibrium.

    If the equations contain rates of inputs (a prescribed motion), z is the state minus a part proportional to the inputs and
    their rates.
    """

    # Names.
    inputs: tuple[str, ...]
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    at_inputs: Floats  # the constant inputs, shape (n_inputs,)
    at_state: Floats  # the equilibrium under these inputs, shape (n_states,)
    # False if there is no equilibrium: the equations were then linearized at the state closest to one.
    rests: bool
    # A, B and C, shapes (n_states, n_states), (n_states, n_inputs) and (n_outputs, n_states).
    state_matrix: Floats
    input_matrix: Floats
    output_matrix: Floats
    feedthrough: Floats  # D, D_1 and D_2, shape (3, n_outputs, n_inputs)
    # Signals with a delay; None if there are none. The matrices, and the poles, are those without delays.
    late: LateSignals | None = None

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], by their size and then by their imaginary part, shape (n_states,)."""
        found = np.linalg.eigvals(self.state_matrix).astype(np.complex128)
        found[np.abs(found) <= _ROUNDED * float(np.max(np.abs(found), initial=0.0))] = 0.0
        # The two poles of a pair have the same size except for rounding.
        return found[np.lexsort((found.imag, np.array([float(f"{abs(pole):.9g}") for pole in found])))]

    @property
    def stability(self) -> Stability:
        """Stability from the poles."""
        # ``"drifts"`` if a pole is zero, so that the rig does not return; ``"undamped"`` if others are on the imaginary axis.
        if np.any(self.poles.real > self._rounding):
            return "unstable"
        on_axis = self.poles[self.poles.real >= -self._rounding]
        if not on_axis.size:
            return "stable"
        return "undamped" if np.any(np.abs(on_axis) > self._rounding) else "drifts"

    @property
    def _rounding(self) -> float:
        return _ROUNDED * float(np.max(np.abs(self.poles), initial=0.0))

    def frequency_response(self, omega: Floats) -> NDArray[np.complex128]:
        """Return the response of every output to every input, delays included, shape (n_frequencies, n_outputs, n_inputs)."""
        s = np.asarray(1j * np.asarray(omega, dtype=np.float64)[:, None, None], dtype=np.complex128)
        inner = self._states_by(s, self.input_matrix)

        def direct(parts: Floats) -> NDArray[np.complex128]:
            return np.asarray(parts[0] + s * parts[1] + s**2 * parts[2])

        found = self.output_matrix @ inner + direct(self.feedthrough)
        if self.late is None:
            return np.asarray(found)
        late = self.late
        change = np.exp(-s * late.delays) - 1.0
        unlooped: NDArray[np.complex128] = np.eye(late.delays.size) - self._loop(s)
        shown: NDArray[np.complex128] = late.from_states @ inner + direct(late.from_inputs)
        signals = np.linalg.solve(unlooped, shown)
        onto = self.output_matrix @ self._states_by(s, late.on_states) + late.on_outputs
        return np.asarray(found + onto @ (np.swapaxes(change, 1, 2) * signals))

    def _states_by(self, s: NDArray[np.complex128], into: Floats) -> NDArray[np.complex128]:
        resolvent = s * np.eye(len(self.states)) - self.state_matrix
        return np.asarray(np.linalg.solve(resolvent, into.astype(np.complex128)))

    def _loop(self, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the effect of each change of a delayed signal on the signals, shape (n_frequencies, n_late, n_late)."""
        assert self.late is not None
        by_changes = self.late.from_states @ self._states_by(s, self.late.on_states) + self.late.on_signals
        return np.asarray(by_changes * (np.exp(-s * self.late.delays) - 1.0))

    @property
    def is_unstable(self) -> bool:
        """Whether motion grows, delays inside loops included."""
        # By the argument principle: without delays stable, with delays unstable if ``det(1 - L)`` with the loop L of their
        # changes turns about zero along the imaginary axis.
        if self.stability == "unstable":
            return True
        late = self.late
        if late is None or not np.any(late.delays) or self.stability == "undamped":
            return False
        quick = max(float(np.max(np.abs(self.poles))), 1.0 / float(np.max(late.delays)))
        omega = np.geomspace(1e-4 * quick, _HIGHEST * quick, _MOST_TURNS)
        omega = np.union1d(
            omega, np.linspace(0.0, _MOST_TURNS * 0.1 / float(np.max(late.delays)), _MOST_TURNS)[1:]
        )
        turned = np.linalg.det(
            np.eye(late.delays.size) - self._loop(np.asarray(1j * omega[:, None, None], dtype=np.complex128))
        )
        return bool(abs(np.unwrap(np.angle(turned))[-1] - np.angle(turned[0])) > np.pi / 2.0)

    def transfer_function(self, source: str, response: str) -> TransferFunction:
        """Return numerator and denominator from one input to one output, without zeros and poles that cancel."""
        column, row = self.inputs.index(source), self.outputs.index(response)
        b, c = self.input_matrix[:, column], self.output_matrix[row]
        direct = self.feedthrough[:, row, column]
        zeros, gain = _zeros(self.state_matrix, b, c, float(direct[0]))
        if np.any(direct[1:] != 0.0):
            improper = np.polymul([direct[2], direct[1], 0.0], _polynomial(self.poles))
            numerator = np.trim_zeros(np.polyadd(gain * _polynomial(zeros), improper), "f")
            zeros, gain = np.roots(numerator).astype(np.complex128), float(numerator[0])
        zeros[np.abs(zeros) <= self._rounding] = 0.0
        zeros, poles = _without_common(zeros, self.poles, self._rounding)
        numerator, denominator = gain * _polynomial(zeros), _polynomial(poles)
        return TransferFunction(source, response, numerator, denominator, zeros, poles)


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """A ratio of polynomials in s."""

    # Names of input and output.
    source: str
    response: str
    # Coefficients, the highest power first; the first of the denominator is 1.
    numerator: Floats
    denominator: Floats
    # Their roots [1/s].
    zeros: NDArray[np.complex128]
    poles: NDArray[np.complex128]


def linearize(
    structure: Structure,
    values: Mapping[str, float],
    inputs: Mapping[str, float] | None = None,
    state: Floats | None = None,
    near: Floats | None = None,
) -> Linearization:
    """Return the linear system close to an equilibrium under constant inputs."""
    names = structure.rig.mechanism.inputs
    at_inputs = np.array([(inputs or {}).get(name, 0.0) for name in names], dtype=np.float64)
    p = parameter_vector(structure, values)
    opened, delays = _opened(structure)
    functions = slope_functions(opened)
    unchanged = np.zeros(len(delays))
    if state is None:
        start = declared_start(structure, p) if near is None else near
        at_state = functions.resting(np.append(start, unchanged), at_inputs, p)
    else:
        at_state = np.append(np.asarray(state, dtype=np.float64), unchanged)
    try:
        (A, direct), (C, D), rests = functions.at(at_state, at_inputs, p)
    except np.linalg.LinAlgError:
        raise SimulationError(
            f"The mass matrix of {structure.rig.name} is singular at the equilibrium."
        ) from None
    # z = x - E_0 u - E_1 u' eliminates the rates of the inputs from the equations.
    E_1 = direct[2]
    E_0 = A @ E_1 + direct[1]
    B, through = direct[0] + A @ E_0, np.stack([D[0] + C @ E_0, D[1] + C @ E_1, D[2]])
    n, n_outputs = len(structure.states), len(structure.rig.outputs)
    known = dict(zip(structure.parameter_symbols, p, strict=True))
    late_signals = LateSignals(
        np.array([float(delay.xreplace(known)) for delay in delays]),
        A[:n, n:],
        C[:n_outputs, n:],
        C[n_outputs:, n:],
        C[n_outputs:, :n],
        through[:, n_outputs:],
    )
    found = Linearization(
        inputs=names,
        states=structure.state_names,
        outputs=tuple(signal.name for signal in structure.rig.outputs),
        at_inputs=at_inputs,
        at_state=at_state[:n],
        rests=rests,
        state_matrix=A[:n, :n],
        input_matrix=B[:n],
        output_matrix=C[:n_outputs, :n],
        feedthrough=through[:, :n_outputs],
        late=late_signals if delays else None,
    )
    parts = (found.state_matrix, found.input_matrix, found.output_matrix, found.feedthrough)
    if not all(np.all(np.isfinite(part)) for part in parts):
        raise SimulationError(
            f"The equations of {structure.rig.name} cannot be linearized at the equilibrium: a root or a quotient has no "
            f"derivative there."
        )
    return found


def is_linear(structure: Structure, values: Mapping[str, float]) -> bool:
    """Return True if the equations are linear and do not depend on time: the linearization is then the model itself."""
    opened, _ = _opened(structure)
    tree, motion = opened.tree, opened.tree.motion
    triples = [input_symbols(index) for index in range(len(structure.rig.mechanism.inputs))]
    moving = {*opened.states, *(symbol for triple in triples for symbol in triple), TIME}
    numbers = map(sp.Float, parameter_vector(structure, values))
    known = dict(zip(structure.parameter_symbols, numbers, strict=True))

    def reported(expression: sp.Expr) -> sp.Expr:
        return tree.flattened(expression).xreplace(known)

    if any(state.limit is not None for state in tree.states):
        return False
    # The mass matrix of an arm is the shortest part that shows that it is not linear.
    if any(reported(mass).free_symbols & moving for mass in motion.mass):
        return False
    parts = [*motion.forces, *(state.rate for state in tree.states)]
    shown = [sp.Add(*output.terms) for output in tree.outputs]

    def is_affine(part: sp.Expr) -> bool:
        own = part.free_symbols & moving
        return not own or (bool(part.is_polynomial(*own)) and sp.total_degree(part, *own) <= 1)

    return all(TIME not in part.free_symbols and is_affine(part) for part in map(reported, [*parts, *shown]))


@lru_cache(maxsize=128)
def _opened(structure: Structure) -> tuple[Structure, tuple[sp.Expr, ...]]:
    """Return a structure with the change of each delayed signal by its delay as a further state, and the delays."""
    # The changes are zero in equilibrium. The signals before their delays are further outputs.
    tree = structure.tree
    changes = {
        d.symbol: sp.Symbol(f"change of {d.symbol.name}", real=True)
        for d in tree.definitions
        if isinstance(d.expression, late)
    }
    if not changes:
        return structure, ()
    definitions, outputs, delays = [], list(tree.outputs), []
    for d in tree.definitions:
        if d.symbol in changes:
            signal, delay = d.expression.args
            outputs.append(Output(d.symbol.name, (signal,)))
            delays.append(delay)
            d = replace(d, expression=signal + changes[d.symbol])
        definitions.append(d)
    states = (*tree.states, *(FirstOrderState(c, (-c,), "1") for c in changes.values()))
    changed = replace(tree, definitions=tuple(definitions), states=states, outputs=tuple(outputs))
    return replace(structure, tree=changed), tuple(delays)


def _zeros(A: Floats, b: Floats, c: Floats, d: float) -> tuple[NDArray[np.complex128], float]:
    """Return the zeros of ``c (s - A)^-1 b + d`` and the factor of its highest power."""
    # They are the finite eigenvalues of the system pencil. Their number follows from the first of d, cb, cAb, ... that is not
    # zero: A. Emami-Naeini and P. Van Dooren, Automatica 18 (1982) 415. With rounding errors, infinite eigenvalues become large
    # finite ones.
    n = A.shape[0]
    size = float(np.max(np.abs(A), initial=0.0)) or 1.0
    leading, largest, count = d, 0.0, n
    markov, bound = b, np.abs(b)
    while abs(leading) <= _VANISHES * largest:
        if count == 0:
            return np.zeros(0, dtype=np.complex128), 0.0
        leading, largest = float(c @ markov), float(np.abs(c) @ bound)
        markov, bound, count = A @ markov, np.abs(A) @ bound, count - 1
    left = np.zeros((n + 1, n + 1))
    left[:n, :n], left[:n, n], left[n, :n], left[n, n] = A / size, b, c, d
    right = np.diag([*np.ones(n), 0.0])
    found = eigvals(left, right)
    found = size * found[np.isfinite(found)]
    return np.asarray(found[np.argsort(np.abs(found))][:count], dtype=np.complex128), leading


def _polynomial(roots: NDArray[np.complex128]) -> Floats:
    """Return the coefficients, with zeros for those that are rounding error."""
    found, largest = np.atleast_1d(np.poly(roots)).real, np.atleast_1d(np.poly(-np.abs(roots)))
    return np.where(np.abs(found) > _VANISHES * largest, found, 0.0)


def _without_common(
    zeros: NDArray[np.complex128], poles: NDArray[np.complex128], distance: float
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """Leave out each zero that lies on a pole, and that pole."""
    kept_zeros, kept_poles = [], list(poles)
    for zero in zeros:
        nearest = min(kept_poles, key=lambda pole: abs(pole - zero), default=None)
        if nearest is not None and abs(nearest - zero) <= distance:
            kept_poles.remove(nearest)
        else:
            kept_zeros.append(zero)
    return np.array(kept_zeros, dtype=np.complex128), np.array(kept_poles, dtype=np.complex128)
