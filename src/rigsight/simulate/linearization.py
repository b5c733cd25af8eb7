"""Linearization of the equations of a rig at its equilibrium.

Derivatives are symbolic. Loops of control laws are closed in the equations, and so in the result. Dry friction is left out,
because its jump at rest has no slope.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvals

from rigsight.errors import SimulationError
from rigsight.simulate.equations.derivatives import declared_start, slope_functions
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.simulation import parameter_vector

Floats = NDArray[np.float64]
Stability = Literal["stable", "drifts", "undamped", "unstable"]

_ROUNDED = 1e-7
"""Distance of two roots, over the largest pole, that may be rounding error: double roots are accurate to the root of 1e-16."""
_VANISHES = 1e-10
"""Share of its parts below which a sum of products is rounding error."""


@dataclass(frozen=True, eq=False)
class Linearization:
    """``z' = A z + B u`` and ``y = C z + D u + D_1 u' + D_2 u''``, all as deviations from the equilibrium.

    If the equations contain rates of inputs (a prescribed motion), z is the state minus a part proportional to the inputs and
    their rates.

    Attributes
    ----------
    inputs, states, outputs
        Names.
    at_inputs
        The constant inputs, shape (n_inputs,).
    at_state
        The equilibrium under these inputs, shape (n_states,).
    rests
        False if there is no equilibrium: the equations were then linearized at the state closest to one.
    state_matrix, input_matrix, output_matrix
        A, B and C, shapes (n_states, n_states), (n_states, n_inputs) and (n_outputs, n_states).
    feedthrough
        D, D_1 and D_2, shape (3, n_outputs, n_inputs).
    """

    inputs: tuple[str, ...]
    states: tuple[str, ...]
    outputs: tuple[str, ...]
    at_inputs: Floats
    at_state: Floats
    rests: bool
    state_matrix: Floats
    input_matrix: Floats
    output_matrix: Floats
    feedthrough: Floats

    @cached_property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], by their size and then by their imaginary part, shape (n_states,)."""
        found = np.linalg.eigvals(self.state_matrix).astype(np.complex128)
        found[np.abs(found) <= _ROUNDED * float(np.max(np.abs(found), initial=0.0))] = 0.0
        # The two poles of a pair have the same size except for rounding.
        return found[np.lexsort((found.imag, np.array([float(f"{abs(pole):.9g}") for pole in found])))]

    @property
    def natural_frequencies(self) -> Floats:
        """Size of each pole [rad/s], shape (n_states,)."""
        return np.abs(self.poles)

    @property
    def damping_ratios(self) -> Floats:
        """Damping ratio of each pole, negative for an unstable pole and NaN for a pole at zero, shape (n_states,)."""
        size = self.natural_frequencies
        safe = np.where(size > self._rounding, size, np.nan)
        return np.asarray(-self.poles.real / safe)

    @property
    def stability(self) -> Stability:
        """Stability from the poles.

        ``"drifts"`` if a pole is zero, so that the rig does not return; ``"undamped"`` if others are on the imaginary axis.
        """
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
        """Return the response of every output to every input, shape (n_frequencies, n_outputs, n_inputs).

        Parameters
        ----------
        omega
            Angular frequencies [rad/s], shape (n_frequencies,); none may be a pole.
        """
        s = 1j * np.asarray(omega, dtype=np.float64)[:, None, None]
        identity = np.eye(len(self.states))
        inner = np.linalg.solve(s * identity - self.state_matrix, self.input_matrix.astype(np.complex128))
        direct = self.feedthrough[0] + s * self.feedthrough[1] + s**2 * self.feedthrough[2]
        return np.asarray(self.output_matrix @ inner + direct)

    def transfer_function(self, source: str, response: str) -> TransferFunction:
        """Return numerator and denominator from one input to one output, without zeros and poles that cancel.

        Raises
        ------
        ValueError
            If there is no such input or output.
        """
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
    """A ratio of polynomials in s.

    Attributes
    ----------
    source, response
        Names of input and output.
    numerator, denominator
        Coefficients, the highest power first; the first of the denominator is 1.
    zeros, poles
        Their roots [1/s].
    """

    source: str
    response: str
    numerator: Floats
    denominator: Floats
    zeros: NDArray[np.complex128]
    poles: NDArray[np.complex128]


def linearize(
    structure: Structure,
    values: Mapping[str, float],
    inputs: Mapping[str, float] | None = None,
    state: Floats | None = None,
    near: Floats | None = None,
) -> Linearization:
    """Return the linear system close to an equilibrium under constant inputs.

    Parameters
    ----------
    structure
        Rig and effects; delays are left out.
    values
        Value of each of the structure's parameters, by name.
    inputs
        Constant value of each input; those left out are zero.
    state
        State at which to linearize instead of the equilibrium, shape (n_states,).
    near
        Of several equilibria, the one closest to this state is used, shape (n_states,); default is the start declared by the rig.

    Raises
    ------
    SimulationError
        If the mass matrix is singular or the equations have no finite derivative there.
    """
    names = structure.rig.mechanism.inputs
    at_inputs = np.array([(inputs or {}).get(name, 0.0) for name in names], dtype=np.float64)
    p = parameter_vector(structure, values)
    functions = slope_functions(structure)
    if state is None:
        at_state = functions.resting(declared_start(structure, p) if near is None else near, at_inputs, p)
    else:
        at_state = np.asarray(state, dtype=np.float64)
    try:
        slopes = functions.at(at_state, at_inputs, p)
    except np.linalg.LinAlgError:
        raise SimulationError(
            f"The mass matrix of {structure.rig.name} is singular at the equilibrium."
        ) from None
    A, direct = slopes.states, slopes.inputs
    # z = x - E_0 u - E_1 u' eliminates the rates of the inputs from the equations.
    E_1 = direct[2]
    E_0 = A @ E_1 + direct[1]
    C = slopes.outputs_by_states
    D = slopes.outputs_by_inputs
    found = Linearization(
        inputs=names,
        states=structure.state_names,
        outputs=tuple(signal.name for signal in structure.rig.outputs),
        at_inputs=at_inputs,
        at_state=at_state,
        rests=slopes.rests,
        state_matrix=A,
        input_matrix=direct[0] + A @ E_0,
        output_matrix=C,
        feedthrough=np.stack([D[0] + C @ E_0, D[1] + C @ E_1, D[2]]),
    )
    parts = (found.state_matrix, found.input_matrix, found.output_matrix, found.feedthrough)
    if not all(np.all(np.isfinite(part)) for part in parts):
        raise SimulationError(
            f"The equations of {structure.rig.name} cannot be linearized at the equilibrium: a root or a quotient has no "
            f"derivative there."
        )
    return found


def _zeros(A: Floats, b: Floats, c: Floats, d: float) -> tuple[NDArray[np.complex128], float]:
    """Return the zeros of ``c (s - A)^-1 b + d`` and the factor of its highest power.

    They are the finite eigenvalues of the system pencil. Their number follows from the first of d, cb, cAb, ... that is not zero:
    A. Emami-Naeini and P. Van Dooren, Automatica 18 (1982) 415. With rounding errors, infinite eigenvalues become large finite
    ones.
    """
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
