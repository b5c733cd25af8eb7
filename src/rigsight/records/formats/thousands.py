"""Does a column of a text have a sign between thousands that was taken for the decimal sign?"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError

_FEWEST_GROUPED = 10
"""Numbers with three digits behind their sign: one in ten decimals without zeros at the end has less, so that in ten numbers one
shows with a probability of 0.65, in the hundreds of a record for certain."""


def refuse_thousands(
    path: Path,
    name: str,
    sign: str,
    cells: Iterable[tuple[int, str]],
    numbers: NDArray[np.float64],
) -> None:
    """Refuse a column whose decimal sign separates thousands: ``39,998`` beside ``998``.

    Decimals are written with as many places in all cells, or without zeros at their end, so that some have less than three.
    """
    finite = numbers[np.isfinite(numbers)]
    whole = finite == np.round(finite)
    # Cheap questions first: of three decimals at most, and numbers with and without.
    if whole.all() or not whole.any() or np.max(np.abs(finite)) >= 1000.0:
        return
    if np.min(np.abs(finite[~whole])) < 1.0 or np.max(np.abs(1e3 * finite - np.round(1e3 * finite))) > 1e-6:
        return
    grouped, plain = [], False
    for number, cell in cells:
        if sign not in cell:
            plain = True
        elif re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}{re.escape(sign)}\d{{3}}", cell):
            grouped.append((number, cell))
        else:
            return
    if plain and len(grouped) >= _FEWEST_GROUPED:
        number, cell = grouped[0]
        raise InputError(
            f"{path.name}, line {number}, column '{name}': '{cell}' has a '{sign}' between thousands: in all "
            f"{len(grouped)} numbers with a '{sign}' three digits follow, and others have none. Export the column without signs "
            "between thousands."
        )
