"""Velocity of a prescribed motion from its measured displacement."""

from __future__ import annotations

from collections import OrderedDict
from hashlib import sha256

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline

_cache: OrderedDict[bytes, tuple[NDArray[np.float64], NDArray[np.float64]]] = OrderedDict()
_CACHED_RECORDS = 64


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
    samples = np.ascontiguousarray(displacement, dtype=np.float64)
    # The cross validation takes seconds on long records, and every candidate asks for the same ones.
    key = sha256(samples.tobytes()).digest()
    if key not in _cache:
        _cache[key] = _spline(samples)
        while len(_cache) > _CACHED_RECORDS:
            _cache.popitem(last=False)
    values, slopes = _cache[key]
    return values, slopes / dt


def _spline(samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    index = np.arange(samples.size, dtype=np.float64)
    scale = float(np.std(samples)) or 1.0
    spline = make_smoothing_spline(index, samples / scale)
    values, slopes = scale * spline(index), scale * spline.derivative()(index)
    values.setflags(write=False)
    return values, slopes
