"""Motion of a rig without effects in a record: states and inputs at its samples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.first_states import rig_state
from rigsight.identify.rig_equations import RigEquations
from rigsight.records.record import Floats, Record
from rigsight.simulate import simulate_outputs

_ACCURACY = 1e-4
"""Relative accuracy of the simulation, more than sufficient for sizes."""
_PIECES = (1, 20)
"""Numbers of pieces into which a record is cut, in turn, until the motion can be simulated and has about the measured size. Each
piece starts from the measured state, because an unstable or drifting rig leaves the measured motion after some time."""
_BEYOND = 3.0
"""Largest ratio of simulated to measured motion; a rig with estimated parameters at its resonance stays below."""


@dataclass(frozen=True)
class RigMotion:
    """States (n_states, n_samples) and inputs with their derivatives (3 n_inputs, n_samples) in a record."""

    z: Floats
    u: Floats


def simulated_motion(equations: RigEquations, record: Record, values: Mapping[str, float]) -> RigMotion:
    """Return the motion of a rig in a record according to its equations."""
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
        # Used if the motion cannot be simulated.
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
    """Return True if no simulated reading has a much larger range than the measured one."""
    shown = equations.readings(z, u, equations.parameters(values, record))
    return all(
        np.ptp(reading) <= _BEYOND * np.ptp(record[name]) or np.ptp(record[name]) == 0.0
        for name, reading in zip(equations.sensor_names, shown, strict=True)
        if name in record
    )
