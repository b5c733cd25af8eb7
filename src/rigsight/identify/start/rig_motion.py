"""Motion of a rig without effects in a record: states and inputs at its samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.rig_equations import RigEquations
from rigsight.records.record import Record
from rigsight.simulate import simulate_outputs

Floats = NDArray[np.float64]

_ACCURACY = 1e-4
"""Relative accuracy of the simulation: sizes need less."""
_PIECES = (1, 20)
"""Into how many pieces a record is cut, each of which starts anew where it was measured, until the motion can be computed and
stays of the size that was measured: a rig that is unstable, or rolls away, leaves it sooner or later."""
_BEYOND = 3.0
"""How many times as far as measured a motion may go: a guessed rig at its resonance stays below."""


@dataclass(frozen=True)
class RigMotion:
    """States (n_states, n_samples) and inputs with their derivatives (3 n_inputs, n_samples) in a record."""

    z: Floats
    u: Floats


def simulated_motion(equations: RigEquations, record: Record, values: Mapping[str, float]) -> RigMotion:
    """Return how a rig moves in a record according to its equations.

    Parameters
    ----------
    equations
        The rig's.
    record
        Its inputs; its first samples tell where the motion begins.
    values
        Constants and parameters by name.
    """
    u = equations.inputs_of(record)[1]
    found: Floats | None = None
    for count in _PIECES:
        edges = np.unique(np.linspace(0, record.n_samples, count + 1).astype(int))
        pieces = [record.slice(int(a), int(b)) for a, b in pairwise(edges)]
        try:
            found = np.concatenate([_states(equations, piece, values) for piece in pieces], axis=1)
        except SimulationError:
            continue
        if _within_reach(equations, record, values, found, u):
            break
    if found is None:
        # For want of a motion that can be computed.
        found = np.repeat(rig_state(equations, record, values)[:, None], record.n_samples, axis=1)
    return RigMotion(found, u)


def _states(equations: RigEquations, record: Record, values: Mapping[str, float]) -> Floats:
    structure = equations.structure
    held, p = equations.inputs_of(record)[0], equations.parameters(values, record)
    start = rig_state(equations, record, values)
    out = simulate_outputs(structure, held, p, start, record.n_samples, _ACCURACY)
    return out[:, len(equations.sensor_names) :].T


def _within_reach(
    equations: RigEquations, record: Record, values: Mapping[str, float], z: Floats, u: Floats
) -> bool:
    """Return True if no sensor shows much more than it did."""
    shown = equations.readings(z, u, equations.parameters(values, record))
    return all(
        np.ptp(reading) <= _BEYOND * np.ptp(record[name]) or np.ptp(record[name]) == 0.0
        for name, reading in zip(equations.sensor_names, shown, strict=True)
        if name in record
    )
