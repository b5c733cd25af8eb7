"""A trial is given up after a number of draws that cannot be simulated or have no gap of the requested size."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np

from rigsight.errors import SimulationError

_ATTEMPTS = 100
"""Draws of a trial, each with its own random numbers. A stand that drifts and a weak effect suit each other once in thirty."""

_STREAMS = 6
"""Sources of randomness of a draw, so that one more number of one thing does not change another."""

Drawn = TypeVar("Drawn")


def first_that_succeeds(draw: Callable[[list[np.random.Generator]], Drawn], seed: int, trial: int) -> Drawn:
    """Return what the first attempt draws that does not fail.

    Parameters
    ----------
    draw
        Draws with the sources of randomness of an attempt.
    seed, trial
        From which everything follows.

    Raises
    ------
    SimulationError
        If all attempts fail, with the reason of the last.
    """
    reason: SimulationError | None = None
    for attempt in range(_ATTEMPTS):
        seeds = np.random.SeedSequence([seed, trial, attempt]).spawn(_STREAMS)
        try:
            return draw([np.random.default_rng(s) for s in seeds])
        except SimulationError as error:
            reason = error
    raise SimulationError(f"Trial {trial} of seed {seed} cannot be drawn: {reason}")
