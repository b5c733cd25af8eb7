"""Number of fixed integration steps for each piece of an input: a sweep needs many at its fast end and one at its slow end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NEEDED_BY = 0.99
"""Share of the pieces that need no more than the full number of steps: those that need more are cut up by events."""


class Substeps(int):
    """The most Runge-Kutta steps that a piece of an input takes, and how many each takes.

    Attributes
    ----------
    needs
        Steps that each piece needs as a share of the most, see `relative_needs`; None where every piece takes the most.
    """

    needs: NDArray[np.float64] | None
    _schedule: NDArray[np.intc] | None

    def __new__(cls, most: int, needs: NDArray[np.float64] | None = None) -> Substeps:
        """Make the most steps of a piece, `needs` saying which need as many."""
        made = super().__new__(cls, most)
        made.needs = needs
        made._schedule = None
        return made

    @property
    def mean(self) -> float:
        """Steps per piece on average: what a simulation costs."""
        return float(self) if self.needs is None else float(np.mean(self.per_piece(self.needs.size)))

    def with_most(self, most: int) -> Substeps:
        """Return the same needs with another number of steps at the most."""
        return Substeps(most, self.needs)

    def per_piece(self, n_pieces: int) -> NDArray[np.intc]:
        """Return the steps of each piece, shape (n_pieces,); all the most where these needs are of another input."""
        if self.needs is None or self.needs.size != n_pieces:
            return np.full(n_pieces, int(self), dtype=np.intc)
        if self._schedule is None:
            # A product such as 3 * (1 / 3) may lie above the whole number that it is.
            steps = np.ceil(self.needs * int(self) - 1e-9)
            self._schedule = np.asarray(np.clip(steps, 1, int(self)), dtype=np.intc)
        return self._schedule


def relative_needs(taken: NDArray[np.intc]) -> NDArray[np.float64]:
    """Return how many steps pieces need in units of what all but a few of them can do with.

    Parameters
    ----------
    taken
        Steps of the accurate integrator in each piece, shape (n_pieces,).
    """
    place = int(_NEEDED_BY * (taken.size - 1))
    return np.asarray(taken / max(float(np.partition(taken, place)[place]), 1.0))
