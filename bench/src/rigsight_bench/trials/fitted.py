"""How much do a rig's equations leave of records, with the numbers that fit best or with given ones?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.records import Record
from rigsight.simulate import Structure


def fitted(
    structure: Structure,
    records: Sequence[Record],
    scales: Mapping[str, float],
    noise: Mapping[str, float],
    start: Mapping[str, float],
    free: Sequence[str] = (),
) -> FitResult:
    """Return a fit to records, or the residuals of given numbers.

    Parameters
    ----------
    structure
        Rig and effects.
    records
        The records.
    scales, noise
        As of `GreyBoxFit`.
    start
        Numbers to begin with.
    free
        Those that the fit moves.

    Raises
    ------
    SimulationError
        If the fit fails.
    """
    found = GreyBoxFit(structure, records, scales, noise).fit(start, list(free))
    if not found.residuals:
        raise SimulationError(
            f"The equations of {structure.rig.name} cannot be fitted to this motion: {found.message}"
        )
    return found


def left_of(found: FitResult) -> NDArray[np.float64]:
    """Return the RMS of what a fit leaves of each reading, shape (n_outputs,)."""
    return np.asarray(np.sqrt(np.nanmean(np.concatenate(found.residuals) ** 2, axis=0)))


def largest_left(found: FitResult, floor: Mapping[str, float]) -> float:
    """Return the largest of these in units of the floor of each."""
    return float(np.max(left_of(found) / np.array(list(floor.values()))))
