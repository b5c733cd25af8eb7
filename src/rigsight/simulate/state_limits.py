"""Limits of each state of a structure for given parameter values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.parameter_expression import at_parameters


def state_limits(structure: Structure, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the half-width of the range that each state cannot leave, infinite for a free state.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values in the order of the structure, shape (n_parameters, n_sets).

    Returns
    -------
    Shape (n_states, n_sets).
    """
    limits = np.full((len(structure.equations), p.shape[1]), np.inf)
    for i, equation in enumerate(structure.equations):
        if equation.limit is not None:
            limits[i] = at_parameters(structure, equation.limit, p)
    return limits
