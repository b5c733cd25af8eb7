"""Springs with memory from the literature on hysteresis.

References
----------
M. A. Krasnosel'skii and A. V. Pokrovskii, *Systems with Hysteresis* (Springer 1989), chapter 1: play and stop.
W. D. Iwan, "A distributed-element model for hysteresis", J. Appl. Mech. 33 (1966) 893: Jenkins elements side by side.
D. J. Segalman, "A four-parameter Iwan model for lap-type joints", J. Appl. Mech. 72 (2005) 752: power-law distribution.
F. Ikhouane and J. Rodellar, *Systems with Hysteresis* (Wiley 2007), chapter 2: the Bouc-Wen model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from rigsight_bench.trials.handwritten.equations.laws import JointLaw

_FREE = 0


class Plays(JointLaw):
    """Play operators side by side: of each, an output that the input pushes along once it has crossed a half-width.

    The memory is the output of each while it rests; while the input pushes it, it is the input less (plus) the half-width.

    Parameters
    ----------
    half_widths
        Of each play [m, rad].
    """

    def __init__(self, half_widths: Sequence[float]) -> None:
        self._half_widths = tuple(half_widths)
        self._pushed = [_FREE] * len(self._half_widths)
        self._resting = [0.0] * len(self._half_widths)

    def outputs(self, x: float) -> list[float]:
        """Return the output of each play [m, rad]."""
        return [
            x - way * half if way else rest
            for way, half, rest in zip(self._pushed, self._half_widths, self._resting, strict=True)
        ]

    def margins(self, x: float, v: float) -> list[float]:
        """Return for each what is left of its width while it rests, or the speed with which it is pushed."""
        return [
            way * v if way else half - abs(x - rest)
            for way, half, rest in zip(self._pushed, self._half_widths, self._resting, strict=True)
        ]

    def switch(self, which: int, x: float, v: float) -> None:  # noqa: ARG002
        """Let a play rest where it is, or have it pushed from now on."""
        if self._pushed[which]:
            self._resting[which] = self.outputs(x)[which]
            self._pushed[which] = _FREE
        else:
            self._pushed[which] = 1 if x > self._resting[which] else -1


class Backlash(Plays):
    """A spring behind a play that is carried along: it takes up the play's output.

    Parameters
    ----------
    stiffness
        Of the joint's spring [N/m, N m/rad].
    half_width
        Of the play [m, rad].
    """

    def __init__(self, stiffness: float, half_width: float) -> None:
        super().__init__([half_width])
        self._stiffness = stiffness

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force of the spring less that of one without play."""
        return self._stiffness * (self.outputs(x)[0] - x)


class Iwan(Plays):
    """Springs with a slider each, side by side: a stop is what its play leaves of the input.

    Parameters
    ----------
    stiffness
        Of all springs and the elastic one at small motion [N/m, N m/rad].
    elastic
        Share of it that never slips.
    slips, weights
        Deflection at which each slips [m, rad], and its share of the stiffness that slips.
    """

    def __init__(
        self, stiffness: float, elastic: float, slips: Sequence[float], weights: Sequence[float]
    ) -> None:
        super().__init__(slips)
        self._stiffness, self._elastic, self._weights = stiffness, elastic, tuple(weights)

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the force of all less that of a spring that never slips."""
        lost = sum(w * output for w, output in zip(self._weights, self.outputs(x), strict=True))
        return -(1.0 - self._elastic) * self._stiffness * lost


def iwan_of_power(stiffness: float, elastic: float, reach: float, power: float) -> Iwan:
    """Return six sliders over 2.7 decades of deflection, whose stiffness goes with a power of where they slip.

    Parameters
    ----------
    stiffness, elastic
        As of `Iwan`.
    reach
        Upper end of the decades [m, rad]; each slider stands in the middle of its sixth.
    power
        Of the slip deflection.
    """
    slips = [reach * 10.0 ** (-2.7 * (11 - 2 * i) / 12.0) for i in range(6)]
    sizes = [slip**power for slip in slips]
    return Iwan(stiffness, elastic, slips, [size / math.fsum(sizes) for size in sizes])


class BoucWen(JointLaw):
    """Part of the spring is hysteretic: ``k z`` with ``z' = A x' - beta |x'| |z|^(n-1) z - gamma x' |z|^n``.

    Parameters
    ----------
    stiffness
        Of the joint's spring [N/m, N m/rad].
    elastic
        Share of it without memory.
    scale, beta, gamma, power
        A, beta, gamma and n.
    """

    n_states: ClassVar[int] = 1

    def __init__(
        self, stiffness: float, elastic: float, scale: float, beta: float, gamma: float, power: float
    ) -> None:
        self._hysteretic = (1.0 - elastic) * stiffness
        self._scale, self._beta, self._gamma, self._power = scale, beta, gamma, power

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the hysteretic force less that of the spring whose place it takes."""
        return self._hysteretic * (z[0] - x)

    def rates(self, x: float, v: float, z: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return the rate of the hysteretic displacement."""
        size = abs(z[0])
        saturation = size**self._power
        along = math.copysign(saturation, z[0]) * abs(v)
        return [self._scale * v - self._beta * along - self._gamma * v * saturation]
