"""A law at a joint: the force that resists its motion, its internal states and its modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar


class JointLaw:
    """A force at a joint beside its linear spring and damper; as it stands here, none.

    `x` is the displacement from where the joint's spring rests [m, rad], `v` its rate, `z` the law's own states.
    """

    n_states: ClassVar[int] = 0

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force that resists the motion [N, N m]."""
        return 0.0

    def rates(self, x: float, v: float, z: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return the rates of the law's states."""
        return []

    def margins(self, x: float, v: float) -> list[float]:  # noqa: ARG002
        """Return numbers that are positive as long as the mode lasts."""
        return []

    def switch(self, which: int, x: float, v: float) -> None:
        """Change the mode after a margin is used up."""


class DryFriction(JointLaw):
    """Friction that holds a joint up to a breakaway force and slides beyond.

    Attributes
    ----------
    direction
        1 or -1 while it slides that way, 0 while it sticks.
    """

    def __init__(self) -> None:
        self.direction = 0

    def sliding(self, direction: int, x: float, v: float) -> float:
        """Return the size of the force while it slides [N, N m], v >= 0 being the speed that way."""
        raise NotImplementedError

    def breakaway(self, direction: int, x: float) -> float:
        """Return the force at which it starts to slide one way [N, N m]."""
        return self.sliding(direction, x, 0.0)

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force while it slides; of a prescribed motion at rest none."""
        way = self.direction or (v > 0.0) - (v < 0.0)
        return way * self.sliding(way, x, abs(v)) if way else 0.0


class FreeMotion(JointLaw):
    """No law: the linear rig."""
