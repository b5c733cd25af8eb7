"""Compiling kernels ahead of use: compilation holds the interpreter, so only processes do it side by side."""

from __future__ import annotations

import contextlib

import numpy as np

from rigsight.errors import SimulationError
from rigsight.simulate.input_hold import hold_input
from rigsight.simulate.kernel_cache import compiled as compiled
from rigsight.simulate.simulation import simulate_outputs, simulate_sets
from rigsight.simulate.structure import Structure


def compile_kernels(structure: Structure, side_by_side_only: bool = False) -> None:
    """Compile the kernels of a structure and keep them on disk, by simulating an instant of rest.

    Parameters
    ----------
    structure
        Rig and effects.
    side_by_side_only
        Leave out the accurate integrator, which a first look does not need.

    Raises
    ------
    InputError
        If the cache folder cannot be written.
    """
    held = hold_input(np.zeros(3), 1e-3, "foh")
    p = np.clip(
        np.ones(len(structure.parameters)),
        [parameter.lower for parameter in structure.parameters],
        [parameter.upper for parameter in structure.parameters],
    )
    state = np.zeros(max(1, len(structure.states)))
    if not side_by_side_only:
        with contextlib.suppress(SimulationError):
            simulate_outputs(structure, held, p, state, 3, 1e-3)
    simulate_sets(structure, held, p[:, None], state[:, None], 3, 1)
