"""What is known of parameters beside the records of a fit: a quadratic cost of other values (regularization).

References
----------
A. N. Tikhonov and V. Y. Arsenin, *Solutions of Ill-Posed Problems* (Winston 1977).
"""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.identify.fit.coordinates import Coordinates
from rigsight.records.record import Floats


@dataclass(frozen=True)
class Prior:
    """Costs d^T C d more per reading, in its squared noise, where the parameters differ by d from known values."""

    names: tuple[str, ...]
    values: Floats  # shape (n,), in units of the parameters
    curvature: Floats  # C, shape (n, n), symmetric, in reciprocal units of two parameters

    def add(
        self, coordinates: Coordinates, theta: Floats, n_readings: int, normal: Floats, gradient: Floats
    ) -> float:
        """Add the normal equations of this cost in place to those of the first coordinates, and return the cost."""
        at = [coordinates.structure.names.index(name) for name in self.names]
        away = coordinates.to_parameters(theta)[at] - self.values
        slopes, curvature = coordinates.derivatives(theta)[at], n_readings * self.curvature
        normal[: theta.size, : theta.size] += slopes.T @ curvature @ slopes
        gradient[: theta.size] += slopes.T @ curvature @ away
        return float(away @ curvature @ away)
