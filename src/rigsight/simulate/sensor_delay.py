"""Readings of delayed sensors from simulated outputs."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.structure import Structure


def as_measured(
    structure: Structure, p: NDArray[np.float64], out: NDArray[np.float64], held: HeldInput
) -> NDArray[np.float64]:
    """Shift outputs by the delays of their sensors; beyond its ends the record is continued with its rates there.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values, shape (n_parameters, n_sets).
    out
        Outputs of the kernel, shape (n_samples, n_computed, n_sets); the last columns are the rates of the delayed outputs.
    held
        Input of the simulation, for its sample time.

    Returns
    -------
    Shape (n_samples, n_outputs, n_sets), by cubic Hermite interpolation: of fourth order in the sample time.
    """
    if not structure.is_shifted:
        return out
    n_samples = out.shape[0]
    visible = out[:, : len(structure.outputs)].copy()
    if n_samples < 2:
        return visible
    dt = held.interval * held.per_sample
    late = [(i, delay) for i, delay in enumerate(structure.shown_late) if delay is not None]
    for column, (output, delay) in enumerate(late, len(structure.outputs)):
        values = _function(structure.parameter_symbols, delay)(*p)
        delays = np.broadcast_to(values, p.shape[1])
        visible[:, output] = _shifted(out[:, output], out[:, column] * dt, delays / dt)
    return visible


def _shifted(
    value: NDArray[np.float64], rise: NDArray[np.float64], delays: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return values, shape (n_samples, n_sets), delayed by numbers of samples (n_sets,); `rise` is their slope per sample."""
    n_samples = value.shape[0]
    shifted = np.empty_like(value)
    for i, delay in enumerate(delays):
        place = np.arange(n_samples) - float(delay)
        start = np.clip(np.floor(place).astype(np.int64), 0, n_samples - 2)
        s = place - start
        x, v = value[:, i], rise[:, i]
        a, b, va, vb = x[start], x[start + 1], v[start], v[start + 1]
        # The values of a set that diverges may overflow.
        with np.errstate(over="ignore", invalid="ignore"):
            inside = a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb)))
        before = np.where(s < 0.0, x[0] + v[0] * place, inside)
        shifted[:, i] = np.where(s > 1.0, x[-1] + v[-1] * (place - (n_samples - 1)), before)
    return shifted


@lru_cache(maxsize=1024)
def _function(symbols: tuple[sp.Symbol, ...], delay: sp.Expr) -> Any:
    return sp.lambdify(symbols, delay, "numpy")
