"""An element with prescribed motion: its force from spring, damper, and a law."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight_bench.trials.handwritten.equations.held_inputs import Input
from rigsight_bench.trials.handwritten.equations.laws import FreeMotion, JointLaw
from rigsight_bench.trials.handwritten.equations.march import march
from rigsight_bench.trials.handwritten.equations.plant import Response, nodes_of
from rigsight_bench.trials.handwritten.equations.springs import CarriedMass
from rigsight_bench.trials.waveforms import Signal

_STEP = 3e-4
"""Of differences by time [s]: at 100 rad/s a rate is then exact to 3e-8 and an acceleration to 1e-8 of its size."""


class Element:
    """An element between a bench's piston and its load cell: F = k x + d x' + force_off + law (Kelvin and Voigt's, and more).

    Parameters
    ----------
    p
        Numbers by name [SI].
    law
        What it has beside spring and damper.
    """

    def __init__(self, p: Mapping[str, float], law: JointLaw | None = None) -> None:
        self._k, self._d, self._force_off = p["k"], p["d"], p["force_off"]
        self._law = law or FreeMotion()
        self._mass = self._law.mass if isinstance(self._law, CarriedMass) else 0.0
        self._n_states = self._law.n_states
        self._x: Signal = float

    def respond(self, motion: Input, dt: float, n_samples: int) -> Response:
        """Move the element and return its force.

        Parameters
        ----------
        motion
            Displacement [m], with two derivatives between its breaks.
        dt
            Sample time [s].
        n_samples
            Number of samples.

        Raises
        ------
        SimulationError
            If events accumulate.
        """
        self._motion = motion
        samples = dt * np.arange(n_samples, dtype=np.float64)
        nodes, at = nodes_of(samples, motion.breaks, modes=bool(self._law.margins(0.0, 0.0)))
        self.hear(nodes[0], nodes[1])
        # What has no memory has no state; one that stays zero is marched in its place.
        start = [0.0] * max(self._n_states, 1)
        shown = [self._shown(nodes[0], start)]
        march(self, start, nodes, lambda t, state: shown.append(self._shown(t, state)))
        force, x, v = np.array(shown)[at].T
        return Response({"force": force}, x, v)

    def _shown(self, t: float, state: Sequence[float]) -> tuple[float, float, float]:
        x, v = self._moved(t)
        force = self._k * x + self._d * v + self._force_off + self._law.resist(x, v, state[: self._n_states])
        return force + self._mass * self._acceleration(t), x, v

    def _moved(self, t: float) -> tuple[float, float]:
        """Return displacement and rate, by a central difference of fourth order."""
        x, h = self._x, _STEP
        rate = (8.0 * (x(t + h) - x(t - h)) - x(t + 2.0 * h) + x(t - 2.0 * h)) / (12.0 * h)
        return x(t), rate

    def _acceleration(self, t: float) -> float:
        x, h = self._x, _STEP
        far, near = x(t + 2.0 * h) + x(t - 2.0 * h), x(t + h) + x(t - h)
        return (16.0 * near - far - 30.0 * x(t)) / (12.0 * h * h)

    def hear(self, begin: float, end: float) -> None:
        """Take the motion between two times [s]."""
        self._x = self._motion.during(begin, end)

    def rates(self, t: float, state: Sequence[float]) -> list[float]:
        """Return the rate of each state of the law."""
        if not self._n_states:
            return [0.0]
        return self._law.rates(*self._moved(t), state)

    def margins(self, t: float, state: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return numbers that are positive as long as the mode of the law lasts."""
        return self._law.margins(*self._moved(t))

    def switch(self, which: int, t: float, state: list[float]) -> None:  # noqa: ARG002
        """Change the mode of the law after a margin is used up."""
        self._law.switch(which, *self._moved(t))
