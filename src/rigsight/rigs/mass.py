"""Can the mass matrix of a rig be inverted? Found by numbers: symbols of large arms take minutes to factorize."""

from __future__ import annotations

import numpy as np
import sympy as sp

from rigsight.rigs.mechanism import Mechanism

_DRAWS = 5
_SINGULAR = 1e-10
"""Smallest eigenvalue of the scaled mass matrix, relative to its largest, that is rounding."""
_SHARE = 0.1
"""Share of a coordinate in the motion without inertia from which it is named."""


def dependent_coordinates(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the degrees of freedom that can move without kinetic energy wherever the rig stands; none for a sound rig."""
    if not mechanism.free:
        return ()
    matrix = mechanism.mass_matrix
    symbols = sorted(matrix.free_symbols, key=str)
    function = sp.lambdify(symbols, matrix, "numpy")
    rng = np.random.default_rng(0)
    motions = []
    for _ in range(_DRAWS):
        mass = np.asarray(function(*rng.uniform(0.5, 2.0, len(symbols))), dtype=np.float64)
        size = np.sqrt(np.maximum(np.abs(np.diag(mass)), 1e-300))
        values, vectors = np.linalg.eigh(mass / np.outer(size, size))
        if values[0] > _SINGULAR * values[-1]:
            return ()
        motions.append(np.abs(vectors[:, 0]))
    shares = np.mean(motions, axis=0)
    return tuple(c.name for c, share in zip(mechanism.free, shares, strict=True) if share > _SHARE)
