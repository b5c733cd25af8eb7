"""A plant composed of rig, law, drive and sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import root

from rigsight.errors import SimulationError
from rigsight_bench.trials.handwritten.equations.drives import DriveLaw
from rigsight_bench.trials.handwritten.equations.held_inputs import Input, Late
from rigsight_bench.trials.handwritten.equations.laws import DryFriction, FreeMotion, JointLaw
from rigsight_bench.trials.handwritten.equations.march import march
from rigsight_bench.trials.handwritten.equations.motions import Joint, Motion
from rigsight_bench.trials.waveforms import Signal

Floats = NDArray[np.float64]

LOOK = 2.5e-3
"""Longest time [s] between two checks of the margins: a mode that ends and returns in between is missed."""
_SAME = 1e-12
"""Distance of two nodes [s] that are one."""
_AT_REST, _BALANCED = 1e-9, 1e-7
"""Accelerations [SI] below which the state from which a rest is looked for is one, and with which the search may end."""


@dataclass(frozen=True)
class Response:
    """The motion of a plant.

    Attributes
    ----------
    readings
        Of each sensor at the samples, without noise, each of shape (n_samples,).
    x, v
        Displacement from rest and rate of the joint at which the law acts, each of shape (n_samples,).
    """

    readings: dict[str, Floats]
    x: Floats
    v: Floats


@dataclass(frozen=True)
class Reading:
    """How a sensor is late.

    Attributes
    ----------
    sensor
        Its name.
    dead_time
        [s].
    lag
        Time constant of its low pass [s]; 0 for none.
    """

    sensor: str
    dead_time: float = 0.0
    lag: float = 0.0


def nodes_of(wanted: Floats, breaks: Sequence[float], *, modes: bool) -> tuple[list[float], NDArray[np.intp]]:
    """Return the times between which a plant is marched, from zero on, and which of them are wanted ones.

    Parameters
    ----------
    wanted
        Times at which the state is asked for [s].
    breaks
        Times at which an input is not smooth [s].
    modes
        True for a plant with modes, which is looked at more often.
    """
    end = float(np.max(wanted))
    looks = np.arange(0.0, end, LOOK) if modes else np.zeros(1)
    all_times = np.unique(np.concatenate([wanted, looks, np.asarray(breaks, dtype=np.float64)]))
    inside = all_times[(all_times >= 0.0) & (all_times <= end)]
    nodes = inside[np.concatenate([[True], np.diff(inside) > _SAME])]
    # Of two times that are one the first is kept.
    found: list[float] = nodes.tolist()
    return found, np.searchsorted(nodes, wanted + _SAME, side="right") - 1


@dataclass
class Plant:
    """A rig with at most one law at one place.

    Attributes
    ----------
    motion
        The rig.
    joint
        Where the law acts, or whose motion is asked for.
    law
        What acts there.
    drive, drive_law
        Name of the drive that is not ideal, and what it does.
    reading
        The sensor that is late.
    """

    motion: Motion
    joint: Joint
    law: JointLaw = field(default_factory=FreeMotion)
    drive: str = ""
    drive_law: DriveLaw = field(default_factory=DriveLaw)
    reading: Reading | None = None

    def __post_init__(self) -> None:
        self._n = len(self.motion.start)
        self._law_end = self._n + self.law.n_states
        self._drive_end = self._law_end + self.drive_law.n_states
        self._friction = self.law if isinstance(self.law, DryFriction) else None
        self._driven = list(self.motion.drives).index(self.drive) if self.drive else -1
        self._late_state = self.motion.sensors[self.reading.sensor] if self.reading else -1
        self._lag = self.reading.lag if self.reading else 0.0
        self._inputs: list[Input] = []
        self._now: list[Signal] = []

    def respond(self, inputs: Sequence[Input], dt: float, n_samples: int) -> Response:
        """Drive the plant from rest and return its readings.

        Parameters
        ----------
        inputs
            Of each drive in the order of the rig.
        dt
            Sample time [s].
        n_samples
            Number of samples.

        Raises
        ------
        SimulationError
            If the motion diverges, events accumulate, or there is no equilibrium to start from.
        """
        late = self.drive_law.dead_time
        self._inputs = [
            Late(signal, late) if i == self._driven and late else signal for i, signal in enumerate(inputs)
        ]
        samples = dt * np.arange(n_samples)
        dead = self.reading.dead_time if self.reading else 0.0
        read = np.maximum(samples - dead, 0.0)
        breaks = [t for signal in self._inputs for t in signal.breaks]
        nodes, where = nodes_of(np.concatenate([samples, read]), breaks, modes=self._has_modes)
        states = march(self, self._rest(), nodes)
        at, seen = states[where[:n_samples]], states[where[n_samples:]]
        readings = {name: at[:, i] for name, i in self.motion.sensors.items()}
        if self.reading:
            readings[self.reading.sensor] = at[:, -1] if self._lag else seen[:, self._late_state]
        pulls, n = np.array(self.joint.pulls), self.motion.n
        return Response(readings, at[:, :n] @ pulls - self.joint.rest, at[:, n : 2 * n] @ pulls)

    @property
    def _has_modes(self) -> bool:
        return self._friction is not None or bool(self.law.margins(0.0, 0.0))

    def _rest(self) -> list[float]:
        """Return the state in which nothing moves as long as no input does."""
        y, n = list(self.motion.start), self.motion.n
        own = [0.0] * (self.law.n_states + self.drive_law.n_states)
        idle = [0.0] * len(self.motion.drives)
        still = [i for i in range(len(y)) if not n <= i < 2 * n]

        def unbalanced(positions: Floats) -> Floats:
            state = list(y)
            for i, value in zip(still, positions, strict=True):
                state[i] = float(value)
            x = sum(s * q for s, q in zip(self.joint.pulls, state, strict=False)) - self.joint.rest
            force = 0.0 if self._friction else self.law.resist(x, 0.0, own)
            rates = self.motion.rates(state, idle, [s * force for s in self.joint.pulls])
            return np.array([*rates[n : 2 * n], *rates[2 * n :]])

        first = np.array([y[i] for i in still])
        if np.max(np.abs(unbalanced(first))) > _AT_REST:
            found = root(unbalanced, first, tol=1e-13).x
            if not np.max(np.abs(unbalanced(found))) < _BALANCED:
                raise SimulationError(
                    "The plant has no equilibrium close to that of the rig without an effect."
                )
            for i, value in zip(still, found, strict=True):
                y[i] = float(value)
        y += own
        return [*y, y[self._late_state]] if self._lag else y

    def hear(self, begin: float, end: float) -> None:
        """Take the inputs between two times [s]."""
        self._now = [signal.during(begin, end) for signal in self._inputs]

    def rates(self, t: float, state: Sequence[float]) -> list[float]:
        """Return the rate of each state."""
        n, motion, law = self.motion.n, self.motion, self.law
        drives = [signal(t) for signal in self._now]
        of_drive: list[float] = []
        if self._driven >= 0:
            own = state[self._law_end : self._drive_end]
            command = drives[self._driven]
            of_drive = self.drive_law.rates(command, own)
            speed = state[n + motion.drives[self.drive]]
            drives[self._driven] = self.drive_law.output(command, speed, own)
        x, v = self._at_joint(state)
        z = state[self._n : self._law_end]
        if self._friction is not None and self._friction.direction == 0:
            force = self._holding(state, drives)
        else:
            force = law.resist(x, v, z)
        rates = motion.rates(state, drives, [s * force for s in self.joint.pulls])
        rates += law.rates(x, v, z)
        rates += of_drive
        if self._lag:
            rates.append((state[self._late_state] - state[-1]) / self._lag)
        return rates

    def _at_joint(self, state: Sequence[float]) -> tuple[float, float]:
        """Return displacement from rest and rate of the joint."""
        pulls, n = self.joint.pulls, self.motion.n
        if n == 1:
            return state[0] - self.joint.rest, state[1]
        return (
            pulls[0] * state[0] + pulls[1] * state[1] - self.joint.rest,
            pulls[0] * state[2] + pulls[1] * state[3],
        )

    def _holding(self, state: Sequence[float], drives: Sequence[float]) -> float:
        """Return the force with which the joint keeps its rate: its acceleration goes linearly with the force."""
        free, pulled = (self._acceleration(state, drives, force) for force in (0.0, 1.0))
        return free / (free - pulled)

    def _acceleration(self, state: Sequence[float], drives: Sequence[float], force: float) -> float:
        pulls, n = self.joint.pulls, self.motion.n
        rates = self.motion.rates(state, drives, [s * force for s in pulls])
        return math.fsum(s * rates[n + i] for i, s in enumerate(pulls))

    def margins(self, t: float, state: Sequence[float]) -> list[float]:
        """Return numbers that are positive as long as the mode lasts."""
        if self._friction is None:
            return self.law.margins(*self._at_joint(state))
        x, v = self._at_joint(state)
        if self._friction.direction:
            return [self._friction.direction * v]
        holding = self._holding(state, self._acting(t, state))
        return [self._friction.breakaway(1, x) - holding, holding + self._friction.breakaway(-1, x)]

    def _acting(self, t: float, state: Sequence[float]) -> list[float]:
        drives = [signal(t) for signal in self._now]
        if self._driven >= 0:
            speed = state[self.motion.n + self.motion.drives[self.drive]]
            own = state[self._law_end : self._drive_end]
            drives[self._driven] = self.drive_law.output(drives[self._driven], speed, own)
        return drives

    def switch(self, which: int, t: float, state: list[float]) -> None:
        """Change the mode after a margin is used up."""
        x, v = self._at_joint(state)
        friction = self._friction
        if friction is None:
            self.law.switch(which, x, v)
            return
        if friction.direction == 0:
            friction.direction = 1 if which == 0 else -1
            return
        holding = self._holding(state, self._acting(t, state))
        if -friction.breakaway(-1, x) <= holding <= friction.breakaway(1, x):
            friction.direction = 0
            self._stop(state, v)
        else:
            friction.direction = 1 if holding > 0.0 else -1

    def _stop(self, state: list[float], v: float) -> None:
        """Take from the first coordinate of the joint the rate that the root of an event leaves."""
        first = next(i for i, pull in enumerate(self.joint.pulls) if pull)
        state[self.motion.n + first] -= self.joint.pulls[first] * v
