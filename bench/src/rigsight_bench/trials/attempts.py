"""A trial is given up after a number of draws that cannot be simulated or have no gap of the requested size."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from rigsight.errors import SimulationError

_ATTEMPTS = 100
"""Draws of a trial, each with its own random numbers. A stand that drifts and a weak effect suit each other once in thirty."""

Drawn = TypeVar("Drawn")


def first_that_succeeds(draw: Callable[[int], Drawn], seed: int, trial: int) -> Drawn:
    """Return what the first attempt draws that does not fail.

    Parameters
    ----------
    draw
        Draws with the random numbers of an attempt.
    seed, trial
        Named where all attempts fail.

    Raises
    ------
    SimulationError
        If all attempts fail, with the reason of the last.
    """
    reason: SimulationError | None = None
    for attempt in range(_ATTEMPTS):
        try:
            return draw(attempt)
        except SimulationError as error:
            reason = error
    raise SimulationError(f"Trial {trial} of seed {seed} cannot be drawn: {reason}")
