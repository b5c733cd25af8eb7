"""Number of fixed integration steps for each piece of an input: a sweep needs many at its fast end and one at its slow end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.model import at_parameters

_NEEDED_BY = 0.99
"""Share of the pieces that need at most the full number of steps; the others need more only because events divide them."""


class Substeps(int):
    """Largest number of Runge-Kutta steps in a piece of an input, and the number in each piece.

    Attributes
    ----------
    needs
        Steps that each piece needs as a share of the largest number, see `relative_needs`; None if all pieces take that number.
    """

    needs: NDArray[np.float64] | None
    _schedule: NDArray[np.intc] | None

    def __new__(cls, most: int, needs: NDArray[np.float64] | None = None) -> Substeps:
        """Create the schedule from the largest number of steps and the `needs` of the pieces."""
        made = super().__new__(cls, most)
        made.needs = needs
        made._schedule = None
        return made

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


def relative_needs(taken: NDArray[np.intc]) -> NDArray[np.float64]:
    """Return the steps that pieces need, relative to a number that is sufficient for all but a few of them."""
    place = int(_NEEDED_BY * (taken.size - 1))
    return np.asarray(taken / max(float(np.partition(taken, place)[place]), 1.0))


def state_limits(structure: Structure, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the half-width of the range that each state cannot leave, infinite for a free state.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values in the order of the structure, shape (n_parameters, n_sets).

    Returns
    -------
    Shape (n_states, n_sets).
    """
    limits = np.full((len(structure.equations), p.shape[1]), np.inf)
    for i, equation in enumerate(structure.equations):
        if equation.limit is not None:
            limits[i] = at_parameters(structure, equation.limit, p)
    return limits
