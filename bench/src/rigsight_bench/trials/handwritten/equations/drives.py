"""Output of a drive from its command.

References
----------
K. J. Astrom and B. Wittenmark, *Computer-Controlled Systems* (Prentice Hall 1997), on dead time and saturation.
H. K. Khalil, *Nonlinear Systems* (Prentice Hall 2002), section 1.2: saturation and dead zone.
A. Hughes and B. Drury, *Electric Motors and Drives* (Newnes 2013), chapter 3: the torque-speed line under a voltage limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar


class DriveLaw:
    """The law between command and force; the base class is ideal.

    `u` is the command in its own unit, `v` the rate along which the drive acts, `z` the law's own states.
    """

    n_states: ClassVar[int] = 0
    dead_time: float = 0.0
    """[s]."""

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the output, in the unit of the command."""
        return u

    def rates(self, u: float, z: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return the rates of the law's states."""
        return []


class DeadTime(DriveLaw):
    """The command acts after a dead time.

    Parameters
    ----------
    late
        By how much [s].
    """

    def __init__(self, late: float) -> None:
        self.dead_time = late


class Lag(DriveLaw):
    """First-order lag: ``T y' + y = u``.

    Parameters
    ----------
    time_constant
        T [s].
    """

    n_states: ClassVar[int] = 1

    def __init__(self, time_constant: float) -> None:
        self._time_constant = time_constant

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the state."""
        return z[0]

    def rates(self, u: float, z: Sequence[float]) -> list[float]:
        """Return its rate."""
        return [(u - z[0]) / self._time_constant]


class RateLimit(DriveLaw):
    """A valve or hoist with limited rate (G. Stein, IEEE Control Syst. Mag. 23 (2003) 12).

    It follows its command with a lag, and no faster than the limit.

    Parameters
    ----------
    fastest
        Largest rate [unit of the command per second].
    time_constant
        Of the lag [s].
    """

    n_states: ClassVar[int] = 1

    def __init__(self, fastest: float, time_constant: float) -> None:
        self._fastest, self._time_constant = fastest, time_constant

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the state."""
        return z[0]

    def rates(self, u: float, z: Sequence[float]) -> list[float]:
        """Return its limited rate."""
        return [max(-self._fastest, min(self._fastest, (u - z[0]) / self._time_constant))]


class Saturation(DriveLaw):
    """The output is limited in both directions.

    Parameters
    ----------
    most
        The limit [unit of the command].
    """

    def __init__(self, most: float) -> None:
        self._most = most

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the limited command."""
        return max(-self._most, min(self._most, u))


class DeadZone(DriveLaw):
    """A dead zone: small commands have no effect, larger ones are reduced by its half width.

    Parameters
    ----------
    half_width
        Largest command that does nothing.
    """

    def __init__(self, half_width: float) -> None:
        self._half_width = half_width

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return what exceeds the zone."""
        if u > self._half_width:
            return u - self._half_width
        return u + self._half_width if u < -self._half_width else 0.0


class TorqueSpeedLine(DriveLaw):
    """The largest output falls in proportion to the speed, and rises against it (Hughes and Drury, chapter 3).

    Parameters
    ----------
    stall
        Largest output at standstill [unit of the command].
    lost
        Output lost per speed.
    """

    def __init__(self, stall: float, lost: float) -> None:
        self._stall, self._lost = stall, lost

    def output(self, u: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the limited command."""
        emf = self._lost * v
        return max(-self._stall - emf, min(self._stall - emf, u))
