"""In which state does a record begin? Guesses from its first samples, for a fit to start from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Record
from rigsight.simulate import Structure

_FIRST_SAMPLES = 7
_RESTING = 1e-3
"""Share of its range within which an input rests."""


def first_state(structure: Structure, record: Record) -> NDArray[np.float64]:
    """Guess the initial state from the first samples: measured outputs, their slope, no memory, settled lags.

    Parameters
    ----------
    structure
        Rig and effects.
    record
        Holds the first output.

    Returns
    -------
    Shape (n_states,), in the units of the states.
    """
    state = np.zeros(len(structure.states))
    if not structure.rig.is_driven:
        return state
    count = min(_FIRST_SAMPLES, record.n_samples)
    time = np.arange(count) * record.dt
    displacement = record[structure.rig.outputs[0].name][:count]
    slope, level = np.polyfit(time, displacement, 1)
    state[0], state[1] = level, slope
    for i, (name, dimension) in enumerate(
        zip(structure.state_names, structure.state_dimensions, strict=True)
    ):
        if name in record and i > 1:
            state[i] = float(np.mean(record[name][:count]))
        elif dimension == "input":
            state[i] = record[structure.rig.inputs[0].name][0]
    return state


def state_at_rest(structure: Structure, record: Record, guess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the guess without motion, shape (n_states,): the mean of the outputs for as long as the input rests.

    Parameters
    ----------
    structure
        Rig and effects.
    record
        Holds the first output.
    guess
        From `first_state`.
    """
    state = guess.copy()
    if not structure.rig.is_driven:
        return state
    drive = record[structure.rig.inputs[0].name]
    moving = np.flatnonzero(np.abs(drive - drive[0]) > _RESTING * float(np.ptp(drive)))
    count = max(_FIRST_SAMPLES, int(moving[0]) if moving.size else record.n_samples)
    state[0], state[1] = float(np.mean(record[structure.rig.outputs[0].name][:count])), 0.0
    for i, name in enumerate(structure.state_names):
        if name in record and i > 1:
            state[i] = float(np.mean(record[name][:count]))
    return state
