"""Accelerations of coupled coordinates: as formulas or, if these are too long, by elimination."""

from __future__ import annotations

import math
from itertools import permutations

import sympy as sp

_MOST_PRODUCTS = 20
"""Products of the determinant of coupled coordinates that are written as formulas. Accelerations hold as many, times those of the
forces. With 8 (two links by their moments) a compiler takes as long as for elimination, with 25 (the same by masses, lengths and
inertias) three times as long, at the same speed of the simulation."""
MOST_COUPLED = 3
"""Coordinates that move one another's inertia and whose accelerations are written as formulas. Those of four links in a plane
take a compiler minutes, those of three a second."""


def has_short_inverse(mass: sp.ImmutableMatrix) -> bool:
    """Return True if at most `MOST_COUPLED` coordinates move one another's inertia, directly or not, by short formulas."""
    return all(
        len(group) <= MOST_COUPLED and (len(group) == 1 or _products(mass, group) <= _MOST_PRODUCTS)
        for group in _coupled(mass)
    )


def _coupled(mass: sp.ImmutableMatrix) -> list[list[int]]:
    """Return the rows of a mass matrix in groups that move one another."""
    left, groups = set(range(mass.rows)), []
    while left:
        group, waiting = [], [left.pop()]
        while waiting:
            row = waiting.pop()
            group.append(row)
            moved = {column for column in left if mass[row, column] != 0}
            left -= moved
            waiting += moved
        groups.append(group)
    return groups


def _products(mass: sp.ImmutableMatrix, group: list[int]) -> int:
    """Return the products in the determinant of a group's rows, each entry written out as a sum."""
    terms = {
        (i, j): len(sp.Add.make_args(mass[i, j])) if mass[i, j] != 0 else 0 for i in group for j in group
    }
    return sum(
        math.prod(terms[i, j] for i, j in zip(group, order, strict=True)) for order in permutations(group)
    )
