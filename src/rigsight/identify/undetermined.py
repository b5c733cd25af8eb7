"""Directions of the coordinates that records do not determine, from a square root of their information matrix."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Floats

_LARGEST_POWER = 3
ONE = 0.03
"""Relative distance up to which a factor between values of the same unit counts as one (and is left out), and a power as a small
fraction."""


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
    """Return the direction with the fewest members among those of a reduced row echelon form, and the members' indices."""
    # A member has a large relative change itself, or a large influence on the outputs.
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


def product_text(factors: Sequence[tuple[str, int]]) -> str:
    """Return a product of powers, as in ``k*m^2/d``."""
    above = [_power(text, power) for text, power in factors if power > 0]
    below = [_power(text, -power) for text, power in factors if power < 0]
    return "*".join(above) + "".join(f"/{text}" for text in below)


def sum_text(first: str, weight: float, second: str, same_unit: bool) -> str:
    """Return ``first + weight second``; the weight is left out if it is one and both have the same unit."""
    factor = "" if same_unit and abs(abs(weight) - 1.0) < ONE else f"{abs(weight):.3g} "
    return f"{first} {'-' if weight < 0.0 else '+'} {factor}{second}"


def small_fraction(ratio: float) -> Fraction | None:
    """Return the fraction of small integers to which a ratio is close, None if there is none; a step along it then decides."""
    nearest = Fraction(ratio).limit_denominator(_LARGEST_POWER)
    close = nearest != 0 and abs(float(nearest) - ratio) <= ONE * abs(ratio)
    return nearest if close and abs(nearest.numerator) <= _LARGEST_POWER else None


def listed(names: Sequence[str]) -> str:
    """Return names as in ``a, b and c``."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def percent(error: float) -> str:
    """Return a relative error in percent, or as a multiple of the value if it is large."""
    return f"{100.0 * error:.2g} %" if error < 10.0 else f"{error:.2g} times its value"


def _power(text: str, power: int) -> str:
    whole = f"({text})" if any(sign in text for sign in " */") else text
    return whole if power == 1 else f"{whole}^{power}"
