"""Which cell has a trial? Every pass over a list of cells is shuffled anew."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Cell = TypeVar("Cell")


def shuffled(cells: Sequence[Cell], turn: int, seed: int, *own: int) -> Cell:
    """Return the cell whose turn it is.

    Parameters
    ----------
    cells
        All cells of a pass.
    turn
        Number of cells that came before, in this pass and in earlier ones.
    seed
        Seed of the whole bench.
    own
        Distinguishes lists of cells that are shuffled by the same seed.
    """
    cycle, row = divmod(turn, len(cells))
    return cells[int(np.random.default_rng([seed, cycle, *own]).permutation(len(cells))[row])]
