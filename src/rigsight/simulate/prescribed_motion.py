"""Velocity of a prescribed motion from its measured displacement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline


def smooth_motion(
    displacement: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return displacement and velocity of the smoothing spline through a measured displacement.

    The amount of smoothing is chosen by generalized cross validation, so that noise and quantization of the sensor do not
    become velocity.

    Parameters
    ----------
    displacement
        Shape (n_samples,).
    dt
        Sample time [s].

    Returns
    -------
    displacement, velocity
        Shape (n_samples,) each; velocity per second.

    References
    ----------
    G. Wahba, *Spline Models for Observational Data* (SIAM 1990), chapter 4.
    """
    index = np.arange(displacement.size, dtype=np.float64)
    scale = float(np.std(displacement)) or 1.0
    spline = make_smoothing_spline(index, displacement / scale)
    return scale * spline(index), scale * spline.derivative()(index) / dt
