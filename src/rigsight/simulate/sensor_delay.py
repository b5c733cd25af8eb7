"""What does a sensor that is late show of a simulated output?"""

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
    """Shift the first output by its sensor's delay; before the record the motion went on as it started.

    Parameters
    ----------
    structure
        Rig and effects.
    p
        Parameter values, shape (n_parameters, n_sets).
    out
        What the kernel computed, shape (n_samples, n_computed, n_sets); the last column is the rate of the first if it is late.
    held
        Input of the simulation, for its sample time.

    Returns
    -------
    Shape (n_samples, n_outputs, n_sets), by cubic Hermite interpolation: of fourth order in the sample time.
    """
    if structure.measured_late is None:
        return out
    n_samples = out.shape[0]
    visible = out[:, : len(structure.outputs)].copy()
    if n_samples < 2:
        return visible
    dt = held.interval * held.per_sample
    delays = np.broadcast_to(_function(structure.parameter_symbols, structure.measured_late)(*p), p.shape[1])
    value, rate = out[:, 0], out[:, -1] * dt
    for i, delay in enumerate(delays):
        place = np.arange(n_samples) - float(delay) / dt
        start = np.clip(np.floor(place).astype(np.int64), 0, n_samples - 2)
        s = place - start
        x, v = value[:, i], rate[:, i]
        a, b, va, vb = x[start], x[start + 1], v[start], v[start + 1]
        inside = a + s * (va + s * (3.0 * (b - a) - 2.0 * va - vb + s * (2.0 * (a - b) + va + vb)))
        visible[:, 0, i] = np.where(s < 0.0, x[0] + v[0] * place, inside)
    return visible


@lru_cache(maxsize=1024)
def _function(symbols: tuple[sp.Symbol, ...], delay: sp.Expr) -> Any:
    return sp.lambdify(symbols, delay, "numpy")
