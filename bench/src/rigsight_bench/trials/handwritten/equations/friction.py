"""Laws of dry friction from the literature.

References
----------
B. Armstrong-Helouvry, P. Dupont and C. Canudas de Wit, "A survey of models, analysis tools and compensation methods for the
control of machines with friction", Automatica 30 (1994) 1083: Coulomb, Stribeck, of direction and of position.
P. R. Dahl, *A Solid Friction Model* (Aerospace Corporation TOR-0158, 1968).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from rigsight_bench.trials.handwritten.equations.laws import DryFriction, JointLaw


class Coulomb(DryFriction):
    """Force of one size against the motion.

    Parameters
    ----------
    level
        Its size [N, N m].
    """

    def __init__(self, level: float) -> None:
        super().__init__()
        self._level = level

    def sliding(self, direction: int, x: float, v: float) -> float:  # noqa: ARG002
        """Return the level."""
        return self._level


class Stribeck(DryFriction):
    """Force that falls from static to kinetic friction, the Gaussian form.

    Parameters
    ----------
    kinetic, static
        Levels far above and at standstill [N, N m].
    velocity
        Characteristic velocity [m/s, rad/s].
    """

    def __init__(self, kinetic: float, static: float, velocity: float) -> None:
        super().__init__()
        self._kinetic, self._static, self._velocity = kinetic, static, velocity

    def sliding(self, direction: int, x: float, v: float) -> float:  # noqa: ARG002
        """Return the point of the Stribeck curve."""
        ratio = v / self._velocity
        return self._kinetic + (self._static - self._kinetic) * math.exp(-ratio * ratio)


class Directional(DryFriction):
    """Coulomb friction of another size each way.

    Parameters
    ----------
    forwards, backwards
        Its sizes [N, N m].
    """

    def __init__(self, forwards: float, backwards: float) -> None:
        super().__init__()
        self._forwards, self._backwards = forwards, backwards

    def sliding(self, direction: int, x: float, v: float) -> float:  # noqa: ARG002
        """Return the size that way."""
        return self._forwards if direction > 0 else self._backwards


class Meshing(DryFriction):
    """Coulomb friction that varies periodically with position, as in meshing gears.

    Parameters
    ----------
    level
        Its mean [N, N m].
    depth
        Relative amplitude of the variation, below 1.
    wave_number
        Periods per displacement times 2 pi [1/m, 1/rad].
    """

    def __init__(self, level: float, depth: float, wave_number: float) -> None:
        super().__init__()
        self._level, self._depth, self._wave_number = level, depth, wave_number

    def sliding(self, direction: int, x: float, v: float) -> float:  # noqa: ARG002
        """Return the level where the joint is."""
        return self._level * (1.0 + self._depth * math.sin(self._wave_number * x))


class Dahl(JointLaw):
    """Friction whose slope falls as it nears its level: dF/dx = sigma (1 - F / F_c sign v) (Dahl's equation with exponent 1).

    The state is the force itself.

    Parameters
    ----------
    level
        Force of sliding F_c [N, N m].
    reach
        Displacement F_c / sigma [m, rad].
    """

    n_states: ClassVar[int] = 1

    def __init__(self, level: float, reach: float) -> None:
        self._level, self._stiffness = level, level / reach

    def resist(self, x: float, v: float, z: Sequence[float]) -> float:  # noqa: ARG002
        """Return the state."""
        return z[0]

    def rates(self, x: float, v: float, z: Sequence[float]) -> list[float]:  # noqa: ARG002
        """Return dF/dx dx/dt."""
        if v == 0.0 or self._level == 0.0:
            return [0.0]
        way = 1.0 if v > 0.0 else -1.0
        return [self._stiffness * (1.0 - way * z[0] / self._level) * v]
