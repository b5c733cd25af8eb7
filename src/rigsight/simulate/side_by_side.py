"""Simulation of many parameter sets of a structure for a fit: side by side, or one with its derivatives, in fixed steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.records.record import Floats
from rigsight.simulate.compiled.kernel import kernel_of
from rigsight.simulate.equations.kinks import freeze
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.model import at_parameters
from rigsight.simulate.simulation import (
    DEFAULT_ACCURACY,
    LOCAL_PER_GLOBAL,
    as_measured,
    read_ahead,
    simulate_outputs,
    state_vector,
)

_NUDGE = 1e-12
"""Perturbation of a state at rest: far below any accuracy, but unstable steps amplify it visibly."""
_CAUTION = 0.6
"""Share of the predicted number of substeps below which numbers are not tried."""
_SUBSTEPS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)

_NEEDED_BY = 0.99
"""Share of the pieces that need at most the full number of steps; the others need more only because events divide them."""


def simulate_sets(
    structure: Structure,
    held: HeldInput,
    p: Floats,
    initial_states: Floats,
    n_samples: int,
    substeps: int | Substeps,
) -> Floats:
    """Return the outputs of parameter sets that are simulated side by side, shape (n_samples, n_outputs, n_sets).

    Parameters have the shape (n_parameters, n_sets), initial states (n_states, n_sets). A set that diverges has NaN or infinity.
    If other signals than inputs are delayed, the sets are simulated accurately one after the other, and the substeps not used.
    """
    held, p = read_ahead(structure, held, p)
    if structure.late_inputs is None:
        # Each needs a history of its own.
        sets, tolerance = [], LOCAL_PER_GLOBAL * DEFAULT_ACCURACY
        for own, state in zip(p.T, initial_states.T, strict=True):
            begin = state_vector(structure, state)
            status, out, _ = kernel_of(structure).simulate_one(held, own, begin, tolerance, n_samples)
            sets.append(out if status == 0 else np.full_like(out, np.nan))
        return as_measured(structure, p, np.stack(sets, axis=2), held)
    steps = Substeps.of(substeps).per_piece(held.n_pieces)
    out = kernel_of(structure).simulate_lanes(held, p, initial_states, steps, n_samples)
    return as_measured(structure, p, out, held)


def carries_tangents(structure: Structure) -> bool:
    """Return True if the kernel of a structure integrates derivatives with the motion, False if it uses differences of sets."""
    return kernel_of(structure).carries_tangents


def differs_at_events(structure: Structure) -> bool:
    """Return True if differences of sets need long steps, because events and steps of each set are located to a tolerance."""
    if structure.is_shifted or structure.late_inputs is None or structure.jumps_at_a_place:
        return True
    return has_dry_friction(structure) and not carries_tangents(structure)


def has_dry_friction(structure: Structure) -> bool:
    """Return True if a joint of a structure can stick."""
    return bool(freeze(structure).frictions)


def simulate_tangents(
    structure: Structure,
    held: HeldInput,
    p: Floats,
    dp: Floats,
    initial_state: Floats,
    initial_slope: Floats,
    n_samples: int,
    substeps: int | Substeps,
) -> Floats:
    """Simulate one parameter set with its derivatives along any directions of parameters and initial states.

    The derivatives of the equations are integrated with the motion, including the reversal of a velocity under dry friction and
    the jump of a delayed held input. No difference step has to be chosen. Shapes are those of `Kernel.tangent_equations` for one
    record;
    that of the result is (n_samples, n_outputs, 1 + n_directions): the outputs, then their derivatives.
    """
    steps = Substeps.of(substeps).per_piece(held.n_pieces)
    return kernel_of(structure).simulate_tangents(held, p, dp, initial_state, initial_slope, steps, n_samples)


def choose_substeps(
    structure: Structure,
    held: HeldInput,
    p: Floats,
    initial_state: Floats,
    n_samples: int,
    accuracy: float,
    most: int = _SUBSTEPS[-1],
    least_sizes: Floats | float = 0.0,
) -> Substeps:
    """Return few substeps whose error is below `accuracy`, relative to the spread of each output or its least size."""
    # Because of kinks, the error decreases with the square of the step; numbers that this rule excludes are not tried.
    if structure.late_inputs is None:
        return Substeps(1)
    taken = np.zeros(held.n_pieces, dtype=np.intc)
    exact = simulate_outputs(structure, held, p, initial_state, n_samples, min(accuracy / 10.0, 1e-5), taken)
    # The squares of a finite motion may overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        size = np.maximum(np.std(exact, axis=0), least_sizes) + 1e-300
    state = np.asarray(initial_state, dtype=np.float64)[:, None]
    # A state exactly at rest would stay at rest even with unstable steps, so it is perturbed.
    both = np.hstack([state, state + _NUDGE * (1.0 + np.abs(state))])
    twice = np.repeat(p[:, None], 2, axis=1)
    least, needs = 1.0, relative_needs(taken)
    for substeps in (number for number in _SUBSTEPS if number <= most):
        if substeps < least:
            continue
        steps = Substeps(substeps, needs)
        fast = simulate_sets(structure, held, twice, both, n_samples, steps)
        with np.errstate(over="ignore", invalid="ignore"):
            errors = np.sqrt(np.mean((fast - exact[:, :, None]) ** 2, axis=0)) / size[:, None]
        error = float(np.max(errors))
        if error <= accuracy:
            return steps
        # An error as large as the motion comes from unstable steps and does not show how many are needed.
        if error < 1.0:
            least = _CAUTION * substeps * np.sqrt(error / accuracy)
    raise SimulationError(
        f"{most} substeps per sample do not reach a relative accuracy of {accuracy:g}; "
        f"the model is too stiff for its sample time."
    )


class Substeps(int):
    """Largest number of Runge-Kutta steps in a piece of an input, and the number in each piece."""

    # Steps that each piece needs as a share of the largest number, see `relative_needs`; None if all pieces
    # take that number.
    needs: Floats | None
    _schedule: NDArray[np.intc] | None

    def __new__(cls, most: int, needs: Floats | None = None) -> Substeps:
        """Create the schedule from the largest number of steps and the `needs` of the pieces."""
        made = super().__new__(cls, most)
        made.needs = needs
        made._schedule = None
        return made

    @classmethod
    def of(cls, substeps: int) -> Substeps:
        """Return the schedule, or one of the same number of steps in every piece."""
        return substeps if isinstance(substeps, Substeps) else cls(substeps)

    @property
    def mean(self) -> float:
        """Mean number of steps per piece, which determines the cost of a simulation."""
        return float(self) if self.needs is None else float(np.mean(self.per_piece(self.needs.size)))

    def with_most(self, most: int) -> Substeps:
        """Return the same needs with another largest number of steps."""
        return Substeps(most, self.needs)

    def per_piece(self, n_pieces: int) -> NDArray[np.intc]:
        """Return the steps of each piece, shape (n_pieces,); the largest number for all if the needs are of another input."""
        if self.needs is None or self.needs.size != n_pieces:
            return np.full(n_pieces, int(self), dtype=np.intc)
        if self._schedule is None:
            # A product such as 3 * (1 / 3) may be slightly above its exact integer value.
            steps = np.ceil(self.needs * int(self) - 1e-9)
            self._schedule = np.asarray(np.clip(steps, 1, int(self)), dtype=np.intc)
        return self._schedule


def relative_needs(taken: NDArray[np.intc]) -> Floats:
    """Return the steps that pieces need, relative to a number that is sufficient for all but a few of them."""
    place = int(_NEEDED_BY * (taken.size - 1))
    return np.asarray(taken / max(float(np.partition(taken, place)[place]), 1.0))


def state_limits(structure: Structure, p: Floats) -> Floats:
    """Return the half-width of the range that each state cannot leave, infinite for a free one, shape (n_states, n_sets)."""
    limits = np.full((len(structure.equations), p.shape[1]), np.inf)
    for i, equation in enumerate(structure.equations):
        if equation.limit is not None:
            limits[i] = at_parameters(structure, equation.limit, p)
    return limits
