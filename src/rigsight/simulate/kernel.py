"""Compiled kernels as functions of arrays. While one runs, other threads of Python run too."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import MachineError
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.structure import Structure

Floats = NDArray[np.float64]

_DOUBLES, _INTS = ctypes.c_void_p, ctypes.c_void_p
_LONG, _DOUBLE, _INT = ctypes.c_long, ctypes.c_double, ctypes.c_int


class Kernel:
    """The two integrators of a structure.

    Parameters
    ----------
    path
        Shared library.
    structure
        What it was compiled from.

    Raises
    ------
    MachineError
        If the library cannot be loaded.
    """

    def __init__(self, path: Path, structure: Structure) -> None:
        self.path = path
        self._n_states = max(1, len(structure.states))
        self._n_computed = len(structure.computed_outputs)
        try:
            loaded = ctypes.CDLL(str(path))
        except OSError as error:
            raise MachineError(
                f"The compiled kernel {path} cannot be loaded ({error}). "
                "Its folder must allow programs to be run from it; set RIGSIGHT_CACHE_DIR to one that does."
            ) from error
        self._one = loaded.simulate_one
        self._one.restype = _INT
        self._one.argtypes = [
            _DOUBLES, _LONG, _DOUBLE, _LONG, _INT, _DOUBLE, _DOUBLES, _DOUBLES, _DOUBLE, _DOUBLES, _LONG, _INTS,
        ]  # fmt: skip
        self._lanes = loaded.simulate_lanes
        self._lanes.restype = None
        self._lanes.argtypes = [
            _DOUBLES, _LONG, _DOUBLE, _LONG, _INTS, _DOUBLE, _DOUBLES, _LONG, _LONG, _DOUBLES, _DOUBLES,
        ]  # fmt: skip

    def simulate_one(
        self,
        held: HeldInput,
        p: Floats,
        state: Floats,
        tolerance: float,
        n_samples: int,
        steps: NDArray[np.intc] | None = None,
    ) -> tuple[int, Floats, Floats]:
        """Advance one parameter set accurately.

        Parameters
        ----------
        held
            Input between its samples.
        p
            Parameters, shape (n_parameters,).
        state
            States at the start, shape (n_states,).
        tolerance
            Error allowed per step, relative to the largest excursion of each state.
        n_samples
            Samples of the input.
        steps
            Where to write how many steps each piece of the input took, shape (n_pieces,).

        Returns
        -------
        status
            0, or why it stopped: 1 for too many steps, 2 for a motion beyond the range of numbers.
        out
            What is computed at each sample, shape (n_samples, n_computed).
        state
            States at the end, shape (n_states,).
        """
        c, p = _doubles(held.coefficients), _doubles(p)
        x = np.zeros(self._n_states)
        x[: state.size] = state
        out = np.zeros((n_samples, self._n_computed))
        status = self._one(
            c.ctypes.data, c.shape[0] - 1, held.interval, held.per_sample, int(held.continuous), 0.0,
            p.ctypes.data, x.ctypes.data, tolerance, out.ctypes.data, n_samples,
            None if steps is None else steps.ctypes.data,
        )  # fmt: skip
        return status, out, x[: state.size]

    def simulate_lanes(
        self, held: HeldInput, p: Floats, states: Floats, substeps: NDArray[np.intc], n_samples: int
    ) -> Floats:
        """Advance many parameter sets side by side.

        Parameters
        ----------
        held
            Input between its samples.
        p
            Parameters, shape (n_parameters, n_sets).
        states
            States at the start, shape (n_states, n_sets).
        substeps
            Runge-Kutta steps in each piece of the input, shape (n_pieces,).
        n_samples
            Samples of the input.

        Returns
        -------
        Shape (n_samples, n_computed, n_sets); a set that diverges holds NaN or infinity.
        """
        c, p = _doubles(held.coefficients), _doubles(p)
        n_sets = p.shape[1]
        x = np.zeros((self._n_states, n_sets))
        x[: states.shape[0]] = states
        out = np.empty((n_samples, self._n_computed, n_sets))
        self._lanes(
            c.ctypes.data, c.shape[0] - 1, held.interval, held.per_sample, substeps.ctypes.data, 0.0,
            p.ctypes.data, p.shape[0], n_sets, x.ctypes.data, out.ctypes.data,
        )  # fmt: skip
        return out


def _doubles(values: Any) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64)
