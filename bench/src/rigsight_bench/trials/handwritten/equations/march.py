"""Integration of a plant with events: scipy's compiled DOP853 from node to node, with events located as roots.

Between two nodes the equations are those of one mode. Where a margin of the mode is negative at the end of an interval, the
moment at which it became so is found by integrating up to trial times (Brent's method), and the plant changes its mode there.
Dry friction is not approximated: a stuck joint has no relative acceleration, a sliding one the force of its law.

References
----------
E. Hairer, S. P. Norsett and G. Wanner, *Solving Ordinary Differential Equations I* (Springer 1993), II.5, II.6.
A. F. Filippov, *Differential Equations with Discontinuous Righthand Sides* (Kluwer 1988), section 1.2, for sticking.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import ode
from scipy.optimize import brentq

from rigsight.errors import SimulationError

_RELATIVE = 1e-10
_ABSOLUTE = 1e-13
"""Error allowed per step, in SI units: every state of the rigs here is larger by nine orders while it moves."""
_ROOT = 1e-14
"""Of a time of an event [s]."""
_EARLY = (0.5, 0.1, 1e-2, 1e-4, 1e-6)
"""Shares of an interval after one of which a margin that begins at zero must have been positive, or it never was."""
_MOST_EVENTS = 200
"""Of one interval: more is chatter."""
_FAR = 1e12


class Moving(Protocol):
    """What can be marched: equations of a mode, margins of that mode, and the mode that follows an event."""

    def hear(self, begin: float, end: float) -> None:
        """Take the inputs between two times [s]."""
        ...

    def rates(self, t: float, state: Sequence[float]) -> list[float]:
        """Return the rate of each state."""
        ...

    def margins(self, t: float, state: Sequence[float]) -> list[float]:
        """Return numbers that are positive as long as the mode lasts; none where there is one mode."""
        ...

    def switch(self, which: int, t: float, state: list[float]) -> None:
        """Change the mode after a margin is used up; may put the state exactly where the event holds it."""
        ...


def march(
    plant: Moving,
    state: Sequence[float],
    nodes: Sequence[float],
    look: Callable[[float, list[float]], None] | None = None,
) -> NDArray[np.float64]:
    """Return the states at all nodes, shape (n_nodes, n_states).

    Parameters
    ----------
    plant
        What moves.
    state
        At the first node.
    nodes
        Times [s], increasing. Inputs must be smooth between two of them.
    look
        Called with time and state at each node but the first, while the plant is in the mode of that time.

    Raises
    ------
    SimulationError
        If the motion diverges, or events accumulate.
    """
    flow = _Flow(plant, max(b - a for a, b in pairwise(nodes)))
    current = list(state)
    states = np.empty((len(nodes), len(current)))
    states[0] = current
    for i, (begin, end) in enumerate(pairwise(nodes), 1):
        plant.hear(begin, end)
        current = _interval(plant, flow, current, begin, end)
        states[i] = current
        if look is not None:
            look(end, current)
    return states


class _Flow:
    """The equations of a mode, integrated from any time to a later one."""

    def __init__(self, plant: Moving, longest: float) -> None:
        self._solver = ode(plant.rates).set_integrator(  # type: ignore[arg-type]
            "dop853", rtol=_RELATIVE, atol=_ABSOLUTE, first_step=longest, nsteps=20_000
        )

    def __call__(self, state: list[float], begin: float, end: float) -> list[float]:
        if end <= begin:
            return list(state)
        self._solver.set_initial_value(state, begin)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reached = self._solver.integrate(end)
        if not self._solver.successful() or not np.all(np.abs(reached) < _FAR):
            raise SimulationError(f"The plant cannot be integrated past {begin:.4g} s.")
        found: list[float] = reached.tolist()
        return found


def _interval(plant: Moving, flow: _Flow, state: list[float], begin: float, end: float) -> list[float]:
    t = begin
    for _ in range(_MOST_EVENTS):
        after = flow(state, t, end)
        broken = [i for i, margin in enumerate(plant.margins(end, after)) if margin < 0.0]
        if not broken:
            return after
        when, which = min((_moment(plant, flow, state, t, end, i), i) for i in broken)
        state = flow(state, t, when)
        t = when
        plant.switch(which, t, state)
        if t >= end:
            return state
    raise SimulationError(f"Events accumulate at {t:.6g} s: the plant chatters.")


def _moment(plant: Moving, flow: _Flow, state: list[float], begin: float, end: float, which: int) -> float:
    """Return when a margin that is used up at the end of an interval becomes so."""

    def margin(t: float) -> float:
        return plant.margins(t, flow(state, begin, t))[which]

    intact = begin
    if margin(begin) <= 0.0:
        # A mode that has just begun begins where its margin is zero.
        tries = (begin + share * (end - begin) for share in _EARLY)
        found = next((t for t in tries if margin(t) > 0.0), None)
        if found is None:
            return begin
        intact = found
    return float(brentq(margin, intact, end, xtol=_ROOT, rtol=1e-15))
