"""Numerical checks of a kinetic energy and of the inertia of every coordinate: symbolic ones of large arms take minutes."""

from __future__ import annotations

import warnings

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.rigs.evaluation import array_function
from rigsight.rigs.mechanism import Mechanism

_DRAWS = 20
"""Drawn parameters need not be those of any rig, so that the mass matrix of a sound one may have any signs."""
_SINGULAR = 1e-10
"""Smallest eigenvalue of the scaled mass matrix, relative to its largest, that is rounding."""
_SHARE = 0.1
"""Share of a coordinate in the motion without inertia from which it is named."""
_ROUNDING = 1e-9
"""Relative difference of two sums of the same terms that is rounding."""


def is_quadratic(mechanism: Mechanism) -> bool:
    """Return True if the kinetic energy is a sum of squares and products of rates.

    Such functions, and no other continuous ones, have ``T(a + b) + T(a - b) = 2 T(a) + 2 T(b)``: P. Jordan, J. von Neumann, Ann.
    Math. 36 (1935) 719. An energy that has no number at any place drawn is none.
    """
    rates = [c.rate for c in mechanism.coordinates]
    others = sorted(mechanism.kinetic.free_symbols - set(rates), key=str)
    energy = array_function([*others, *rates], mechanism.kinetic)
    rng = np.random.default_rng(0)
    found = []
    for _ in range(_DRAWS):
        numbers, a, b = (rng.uniform(0.5, 2.0, len(own)) for own in (others, rates, rates))
        parts = np.array([_number(energy, numbers, r) for r in (a + b, a - b, a, b)])
        if np.all(np.isfinite(parts)):
            found.append(
                abs(parts @ (1.0, 1.0, -2.0, -2.0)) <= _ROUNDING * np.sum(np.abs(parts)),
            )
    return bool(found) and all(found)


def _number(function: object, *arguments: NDArray[np.float64]) -> float:
    assert callable(function)
    with warnings.catch_warnings():
        # A root of what is negative at one place of many is no news.
        warnings.simplefilter("ignore")
        value = function(*np.concatenate(arguments))
    return float(np.real(value)) if np.isreal(value) else np.nan


def dependent_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the degrees of freedom that can move without kinetic energy wherever the rig stands; none for a sound rig."""
    matrix = mechanism.mass_matrix
    if not mechanism.free:
        return ()
    symbols = sorted(matrix.free_symbols, key=str)
    function = array_function(symbols, matrix)
    rng = np.random.default_rng(0)
    motions = []
    for _ in range(_DRAWS):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            mass = np.asarray(function(*rng.uniform(0.5, 2.0, len(symbols))))
        if not (np.all(np.isreal(mass)) and np.all(np.isfinite(mass))):
            continue
        mass = np.real(mass).astype(np.float64)
        size = np.sqrt(np.maximum(np.abs(np.diag(mass)), 1e-300))
        values, vectors = np.linalg.eigh(mass / np.outer(size, size))
        order = np.argsort(np.abs(values))
        if abs(values[order[0]]) > _SINGULAR * abs(values[order[-1]]):
            return ()
        motions.append(np.abs(vectors[:, order[0]]))
    shares = np.mean(motions, axis=0) if motions else np.ones(len(mechanism.free))
    return tuple(c.name for c, share in zip(mechanism.free, shares, strict=True) if share > _SHARE)


def negative_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the degrees of freedom whose own inertia is negative whatever the parameters; none for a sound rig."""
    found, places = [], {c.symbol for c in mechanism.coordinates}
    for index, coordinate in enumerate(mechanism.free):
        inertia = mechanism.mass_matrix[index, index]
        positive = {s: sp.Symbol(s.name, positive=True) for s in inertia.free_symbols - places}
        if inertia.xreplace(positive).is_negative:
            found.append(coordinate.name)
    return tuple(found)
