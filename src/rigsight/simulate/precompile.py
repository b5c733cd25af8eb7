"""Compiling kernels ahead of use: compilation holds the interpreter, so only processes do it side by side."""

from __future__ import annotations

import contextlib

import numpy as np

from rigsight.errors import SimulationError
from rigsight.simulate.input_hold import hold_input
from rigsight.simulate.kernel_cache import compiled as compiled
from rigsight.simulate.simulation import simulate_outputs, simulate_sets
from rigsight.simulate.structure import Structure


def compile_kernels(structure: Structure) -> None:
    """Compile all kernels of a structure and keep them on disk, by simulating an instant of rest.

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
    with contextlib.suppress(SimulationError):
        simulate_outputs(structure, held, p, state, 3, 1e-3)
    simulate_sets(structure, held, p[:, None], state[:, None], 3, 1)
