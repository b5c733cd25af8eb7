"""How many fixed steps does each piece of an input need? A sweep needs many at its fast end and one at its slow end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_NEEDED_BY = 0.99
"""Share of the pieces that need no more than the full number of steps: those that need more are cut up by events."""


class Substeps(int):
    """The most Runge-Kutta steps that a piece of an input takes, and how many each takes.

    Attributes
    ----------
    taken
        Steps of the accurate integrator in each piece, shape (n_pieces,); None where every piece takes the most.
    """

    taken: NDArray[np.intc] | None
    _schedule: NDArray[np.intc] | None

    def __new__(cls, most: int, taken: NDArray[np.intc] | None = None) -> Substeps:
        """Make the most steps of a piece, `taken` saying which need as many."""
        made = super().__new__(cls, most)
        made.taken = taken
        made._schedule = None
        return made

    def with_most(self, most: int) -> Substeps:
        """Return the same needs with another number of steps at the most."""
        return Substeps(most, self.taken)

    def per_piece(self, n_pieces: int) -> NDArray[np.intc]:
        """Return the steps of each piece, shape (n_pieces,); all the most where these needs are of another input."""
        if self.taken is None or self.taken.size != n_pieces:
            return np.full(n_pieces, int(self), dtype=np.intc)
        if self._schedule is None:
            place = int(_NEEDED_BY * (n_pieces - 1))
            full = max(float(np.partition(self.taken, place)[place]), 1.0)
            # A product such as 3 * (1 / 3) may lie above the whole number that it is.
            steps = np.ceil(self.taken * (int(self) / full) - 1e-9)
            self._schedule = np.asarray(np.clip(steps, 1, int(self)), dtype=np.intc)
        return self._schedule
