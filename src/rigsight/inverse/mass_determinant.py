"""How much the determinant of the mass matrix along the motion changes with the numbers of the equations.

Residuals of equations of motion are forces. Their density as a function of the accelerations holds this determinant: equations in
which all masses and forces shrink leave less force and predict no acceleration better.

References
----------
A. Papoulis, *Probability, Random Variables, and Stochastic Processes* (McGraw-Hill 1991), for transformed densities.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from rigsight.inverse.equation_fit import EquationFit

Floats = NDArray[np.float64]

_SAMPLES = 8
"""Samples of each motion over which the mass matrix is averaged (a convention)."""
_SMALL = 1e-4
"""Relative change of a number from which the change of the mass matrix is taken."""


class MassDeterminant:
    """The mass matrix of a rig to first order in the numbers of its equations."""

    def __init__(self, fit: EquationFit, values: Mapping[str, float]) -> None:
        self.order = fit.motions[0].equations.n_coordinates
        self._start = _masses(fit, values)
        slopes = np.zeros((len(fit.free), *self._start.shape))
        for slope, name in zip(slopes, fit.free, strict=True):
            step = _SMALL * (abs(values[name]) or 1.0)
            slope[:] = (_masses(fit, {**values, name: values[name] + step}) - self._start) / step
        self._slopes = slopes
        self._log_start = np.linalg.slogdet(self._start)[1]

    @property
    def is_open(self) -> bool:
        """Whether numbers change the mass matrix."""
        return bool(np.any(self._slopes))

    def log_ratio(self, change: Floats) -> Floats:
        """Return the mean logarithm of the determinant after a change of the numbers, less that before it.

        Parameters
        ----------
        change
            Shape (.., n_numbers).

        Returns
        -------
            Shape (..,); minus infinity where a mass is not positive.
        """
        sign, log = np.linalg.slogdet(self._changed(change))
        return np.asarray(np.mean(np.where(sign > 0.0, log, -np.inf) - self._log_start, axis=-1))

    def slope(self, change: Floats) -> Floats:
        """Return the derivatives of `log_ratio` by the numbers, of the same shape as their change."""
        inverse = np.linalg.pinv(self._changed(change))
        return np.asarray(np.einsum("...kij,fkji->...f", inverse, self._slopes) / len(self._start))

    def _changed(self, change: Floats) -> Floats:
        return np.asarray(self._start + np.tensordot(change, self._slopes, axes=(-1, 0)))


def _masses(fit: EquationFit, values: Mapping[str, float]) -> Floats:
    """Return the mass matrix at some samples of all motions, shape (n_samples, n_coordinates, n_coordinates)."""
    found = []
    for motion in fit.motions:
        at = np.linspace(0, motion.record.n_samples - 1, _SAMPLES).astype(np.int64)
        p = motion.equations.parameters(values, motion.record)
        found.append(motion.equations.mass(motion.z[:, at], motion.u[:, at], p) * fit.per_input(values))
    return np.concatenate(found)
