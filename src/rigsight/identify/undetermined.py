"""Directions of the coordinates that records do not determine, from a square root of their information matrix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

POORLY_KNOWN = 0.5
"""Relative standard error from which a parameter is not determined: its 95 % interval reaches zero, or twice the value."""
TAKES_PART = 0.05
"""Share of the largest change, or influence, from which a parameter is a member of a direction."""
ROUNDING = 1e-9
"""Entry of a unit direction below which it is rounding error."""


def marginal_errors(root: Floats) -> Floats:
    """Return the standard error of each coordinate, infinite if it has a component in an undetermined direction."""
    _, singular, right = np.linalg.svd(root, full_matrices=True)
    sizes = np.zeros(root.shape[1])
    sizes[: singular.size] = singular
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = np.where(np.abs(right) > ROUNDING, np.abs(right) / sizes[:, None], 0.0)
    return np.asarray(np.sqrt(np.sum(parts**2, axis=0)))


def conditional_errors(root: Floats) -> Floats:
    """Return the standard error of each coordinate if all others were known."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.linalg.norm(root, axis=0))


def undetermined(root: Floats) -> Floats:
    """Return an orthonormal basis of the directions with a larger standard error than a poorly known parameter."""
    _, singular, right = np.linalg.svd(root, full_matrices=True)
    sizes = np.zeros(root.shape[1])
    sizes[: singular.size] = singular
    return np.asarray(right[sizes * POORLY_KNOWN < 1.0].T)


def sparsest(free: Floats, influence: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Return the direction with the fewest members among those of a reduced row echelon form, and the members' indices.

    A member has a large relative change itself, or a large influence on the outputs.
    """
    rows = (free * influence[:, None]).T
    for place in range(rows.shape[0]):
        pivot = np.unravel_index(np.argmax(np.abs(rows[place:])), rows[place:].shape)
        row, column = place + int(pivot[0]), int(pivot[1])
        rows[[place, row]] = rows[[row, place]]
        rows[place] /= rows[place, column]
        others = np.arange(rows.shape[0]) != place
        rows[others] -= np.outer(rows[others, column], rows[place])
    directions = rows / influence
    members = [
        np.flatnonzero(
            (np.abs(row) >= TAKES_PART * np.max(np.abs(row)))
            | (np.abs(direction) >= TAKES_PART * np.max(np.abs(direction)))
        )
        for row, direction in zip(rows, directions, strict=True)
    ]
    best = min(range(len(members)), key=lambda i: members[i].size)
    return directions[best], members[best]
