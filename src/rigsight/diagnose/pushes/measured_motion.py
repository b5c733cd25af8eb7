"""Motion of the joints in a record: that of the equations, corrected by the residuals of the sensors."""

from __future__ import annotations

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects.symbols import derivative
from rigsight.rigs import Rig

_DETERMINED = 1e-6
"""Smallest singular value, relative to the largest, from which the coordinates count as shown by the sensors."""


class Corrections:
    """Difference of each joint's motion from a simulation, computed from the differences of the sensor readings.

    Only sensors that read a sum of coordinates are used, and only if together they determine all degrees of freedom.

    Parameters
    ----------
    rig
        The rig.
    """

    def __init__(self, rig: Rig) -> None:
        mechanism = rig.mechanism
        coordinates = [coordinate.symbol for coordinate in mechanism.free]
        numbers = {sp.Symbol(p.name, real=True) for p in (*rig.constants, *rig.parameters)}
        self._joints = {joint.name: _slopes(joint.motion, coordinates, numbers) for joint in mechanism.joints}
        self._sensors = {
            sensor.name: _slopes(sensor.reads, coordinates, numbers) for sensor in mechanism.sensors
        }
        self._names = [sensor.name for sensor in mechanism.sensors]
        self._n = len(coordinates)

    def of_joint(
        self, name: str, differences: NDArray[np.float64], measured: set[str]
    ) -> NDArray[np.float64] | None:
        """Return the correction of a joint's motion, shape (n_samples,); None where the sensors do not tell."""
        slopes = self._joints[name]
        asked = [i for i, n in enumerate(self._names) if n in measured and self._sensors[n] is not None]
        if slopes is None or not asked:
            return None
        shown = np.array([self._sensors[self._names[i]] for i in asked])
        singular = np.linalg.svd(shown, compute_uv=False)
        if singular.size < self._n or singular[-1] <= _DETERMINED * singular[0]:
            return None
        return np.asarray(differences[:, asked] @ np.linalg.pinv(shown).T @ slopes)


def _slopes(
    expression: sp.Expr, coordinates: list[sp.Symbol], numbers: set[sp.Symbol]
) -> NDArray[np.float64] | None:
    """Return the derivatives by each coordinate of a sum of multiples of them and numbers; None for any other expression."""
    slopes = [derivative(expression, coordinate) for coordinate in coordinates]
    if any(not slope.is_number for slope in slopes) or not any(slopes):
        return None
    rest = sp.expand(expression - sum(s * c for s, c in zip(slopes, coordinates, strict=True)))
    return np.array(slopes, dtype=np.float64) if rest.free_symbols <= numbers else None
