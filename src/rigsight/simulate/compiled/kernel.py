"""Compiled kernels as functions of arrays, kept by structure. While one runs, other Python threads can run."""

from __future__ import annotations

import ctypes
import hashlib
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import MachineError
from rigsight.libraries import is_kept, library_file
from rigsight.records.record import Floats
from rigsight.simulate.compiled.kernel_source import kernel_source
from rigsight.simulate.equations.structure import Structure
from rigsight.simulate.input_hold import HeldInput

_TYPES: dict[str, Any] = {"a": ctypes.c_void_p, "l": ctypes.c_long, "d": ctypes.c_double, "i": ctypes.c_int}
"""Types of arguments: address of an array, long, double, int."""

_kernels: dict[str, Kernel] = {}
_keys: dict[Structure, str] = {}
_texts: dict[Structure, str] = {}
"""C texts of structures whose kernel is not loaded yet; printing a text takes some 20 ms."""
_lock = threading.Lock()
_made: dict[str, threading.Lock] = {}
"""A lock for each kernel, so that it is compiled only once while others may be compiled at the same time."""


class _FittedRecord(ctypes.Structure):
    """The C structure ``fitted_record`` of the kernel."""

    _fields_ = [
        (field[2:], _TYPES[field[0]])
        for field in (
            "a c", "l n_pieces", "d length", "l per_sample", "a substeps", "d start_time", "a measured", "a weights",
        )
    ]  # fmt: skip


class FittedRecord:
    """A record to which parameter sets are fitted: with steps of shape (n_pieces,) and outputs (n_samples, n_outputs).

    Weights are factors of the residuals, shape (n_outputs,); 0 for an output that was not measured.
    """

    def __init__(
        self, held: HeldInput, substeps: NDArray[np.intc], measured: Floats, weights: Floats
    ) -> None:
        # The kernel reads these arrays by their addresses, so they must be kept as long as this object.
        self._arrays = (_doubles(held.coefficients), substeps, _doubles(measured), _doubles(weights))
        c, steps, values, factors = self._arrays
        self.as_c = _FittedRecord(
            c.ctypes.data, c.shape[0] - 1, held.interval, held.per_sample, steps.ctypes.data,
            0.0, values.ctypes.data, factors.ctypes.data,
        )  # fmt: skip


class Kernel:
    """The integrators of a structure that was compiled to a shared library."""

    def __init__(self, path: Path, structure: Structure) -> None:
        self.path = path
        self._n_states = max(1, len(structure.states))
        self._n_computed = len(structure.computed_outputs)
        try:
            loaded = ctypes.CDLL(str(path))
        except OSError as error:
            raise MachineError(
                f"The compiled kernel {path} cannot be loaded ({error}). "
                "Its folder must permit execution; set RIGSIGHT_CACHE_DIR to a folder that does."
            ) from error
        self._bodies = structure.rig.mechanism.bodies
        if self._bodies is not None:
            self._bodies.program.connect(loaded)
        self._one = _function(loaded, "simulate_one", "a l d l i d a a d a l a")
        self.carries_tangents = hasattr(loaded, "tangent_equations")
        """True if `tangent_equations` and `simulate_tangents` are available, False if `normal_equations` is."""
        if structure.late_inputs is None:
            return
        self._lanes = _function(loaded, "simulate_lanes", "a l d l a d a l l a a", None)
        if self.carries_tangents:
            self._tangents = _function(loaded, "tangent_equations", "a l a a l a a l a a")
        else:
            self._normal = _function(loaded, "normal_equations", "a l a l l a a")

    def simulate_one(
        self,
        held: HeldInput,
        p: Floats,
        state: Floats,
        tolerance: float,
        n_samples: int,
        steps: NDArray[np.intc] | None = None,
    ) -> tuple[int, Floats, Floats]:
        """Advance one parameter set accurately."""
        c, p, x = _doubles(held.coefficients), _doubles(p), self._states(state, 0)
        out = np.zeros((n_samples, self._n_computed))
        status = self._one(
            c.ctypes.data, c.shape[0] - 1, held.interval, held.per_sample, int(held.continuous), 0.0,
            p.ctypes.data, x.ctypes.data, tolerance, out.ctypes.data, n_samples,
            None if steps is None else steps.ctypes.data,
        )  # fmt: skip
        self._check_bodies()
        return status, out, x[: state.size]

    def simulate_lanes(
        self, held: HeldInput, p: Floats, states: Floats, substeps: NDArray[np.intc], n_samples: int
    ) -> Floats:
        """Advance many parameter sets side by side."""
        c, p, x = _doubles(held.coefficients), _doubles(p), self._states(states, 0)
        n_sets = p.shape[1]
        out = np.empty((n_samples, self._n_computed, n_sets))
        self._lanes(
            c.ctypes.data, c.shape[0] - 1, held.interval, held.per_sample, substeps.ctypes.data, 0.0,
            p.ctypes.data, p.shape[0], n_sets, x.ctypes.data, out.ctypes.data,
        )  # fmt: skip
        self._check_bodies()
        return out

    def normal_equations(self, records: Sequence[FittedRecord], p: Floats, states: Floats) -> Floats:
        """Return the products of weighted residuals and differences that least squares need, shape (n_records, n_sets, n_sets).

        Outputs are not stored: for many records and sets, moving them through memory would take longer than computing them.
        Parameters have the shape (n_parameters, n_sets), states (n_records, n_states, n_sets). Readings of delayed sensors are
        those before the delay, which is applied after a simulation.
        """
        n_sets, p, x = p.shape[1], _doubles(p), self._states(states, 1)
        products, listed = np.empty((len(records), n_sets, n_sets)), _listed(records)
        failed = self._normal(
            ctypes.addressof(listed), len(records), p.ctypes.data, p.shape[0], n_sets, x.ctypes.data,
            products.ctypes.data,
        )  # fmt: skip
        self._check_bodies()
        if failed:
            raise MachineError(f"Not enough memory to simulate {n_sets} parameter sets side by side.")
        return products

    def tangent_equations(
        self, records: Sequence[FittedRecord], p: Floats, dp: Floats, states: Floats, dstates: Floats
    ) -> Floats:
        """Return the products of weighted residuals and their derivatives that a least-squares step needs for some records.

        Their shape is (n_records, 1 + n_directions, 1 + n_directions). Parameters have the shape (n_parameters,), their
        derivatives along each direction (n_parameters, n_directions), states (n_records, n_states) and their derivatives, the
        same for all records, (n_states, n_directions).
        """
        width = 1 + dp.shape[1]
        products = np.empty((len(records), width, width))
        self._carry(records, p, dp, states, dstates, products.ctypes.data, None)
        return products

    def simulate_tangents(
        self, held: HeldInput, p: Floats, dp: Floats, state: Floats, dstate: Floats,
        substeps: NDArray[np.intc], n_samples: int,
    ) -> Floats:  # fmt: skip
        """Simulate one parameter set with its derivatives."""
        out = np.empty((n_samples, self._n_computed, 1 + dp.shape[1]))
        record = FittedRecord(held, substeps, np.zeros((0, self._n_computed)), np.zeros(self._n_computed))
        self._carry([record], p, dp, state[None], dstate, None, out.ctypes.data)
        return out

    def _states(self, states: Floats, axis: int) -> Floats:
        """Return states with as many along an axis as a kernel has, which is one at least."""
        x = np.zeros((*states.shape[:axis], self._n_states, *states.shape[axis + 1 :]))
        x[(slice(None),) * axis + (slice(states.shape[axis]),)] = states
        return x

    def _check_bodies(self) -> None:
        """Raise the error that another simulator reported while the kernel called it."""
        if self._bodies is not None:
            self._bodies.program.check()

    def _carry(
        self, records: Sequence[FittedRecord], p: Floats, dp: Floats, states: Floats, dstates: Floats,
        products: int | None, out: int | None,
    ) -> None:  # fmt: skip
        n_directions, x, dx = dp.shape[1], self._states(states, 1), self._states(dstates, 0)
        p, dp, listed = _doubles(p), _doubles(dp), _listed(records)
        failed = self._tangents(
            ctypes.addressof(listed), len(records), p.ctypes.data, dp.ctypes.data, p.size, x.ctypes.data, dx.ctypes.data,
            n_directions, products, out,
        )  # fmt: skip
        self._check_bodies()
        if failed:
            raise MachineError(f"Not enough memory to simulate {n_directions} derivatives side by side.")


def _function(library: ctypes.CDLL, name: str, arguments: str, result: Any = ctypes.c_int) -> Any:
    """Return a function of a library that takes arguments of `_TYPES`."""
    function = getattr(library, name)
    function.restype, function.argtypes = result, [_TYPES[own] for own in arguments.split()]
    return function


def _doubles(values: Any) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64)


def _listed(records: Sequence[FittedRecord]) -> Any:
    return (_FittedRecord * len(records))(*(record.as_c for record in records))


def kernel_of(structure: Structure) -> Kernel:
    """Return the compiled kernels of a structure, compiling them if this machine has not yet done so."""
    known = _loaded(structure)
    if known is not None:
        return known
    with _lock:
        known = _loaded(structure)
        if known is not None:
            return known
        # Threads write texts one after the other, which is no slower in pure Python. The compilers run in parallel.
        text = _text(structure)
        key = hashlib.sha256(text.encode()).hexdigest()
        own = _made.setdefault(key, threading.Lock())
    with own:
        if key not in _kernels:
            bodies = structure.rig.mechanism.bodies
            folders = () if bodies is None else bodies.program.include_folders
            _kernels[key] = Kernel(library_file(text, folders), structure)
        _keys[structure] = key
        _texts.pop(structure, None)
        return _kernels[key]


def _loaded(structure: Structure) -> Kernel | None:
    key = _keys.get(structure)
    return None if key is None else _kernels.get(key)


def compiled(structure: Structure) -> bool:
    """Return True if the machine code of a structure's kernels is loaded or in the cache."""
    return _loaded(structure) is not None or is_kept(_text(structure))


def _text(structure: Structure) -> str:
    text = _texts.get(structure)
    if text is None:
        text = _texts[structure] = kernel_source(structure)
    return text
