"""Velocity and acceleration of a prescribed motion from its measured displacement."""

from __future__ import annotations

from collections import OrderedDict
from functools import lru_cache
from hashlib import sha256
from threading import Lock

import numpy as np
from scipy.fft import dct, idct, idst
from scipy.interpolate import make_interp_spline, make_smoothing_spline
from scipy.optimize import minimize_scalar

from rigsight.records.record import Floats
from rigsight.simulate.input_hold import continued

_cache: OrderedDict[bytes, tuple[Floats, Floats, Floats]] = OrderedDict()
_cache_lock = Lock()
_CACHED_SAMPLES = 2_000_000
"""Number of samples of all records in the cache, 48 MB: a campaign has few records, or hundreds of short windows of them."""
_PENALTIES = (-16.0, 25.0)
"""Natural logarithm of the weights tried: from no smoothing at all to a straight line."""
_TRIALS = 42
_BEYOND = 48
"""Samples that are predicted beyond either end: a spline that averages over a dozen is not affected by its own end there."""
_END = 21
"""Samples from which the slope at an end is computed."""


def smooth_motion(displacement: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return the smoothing spline through a measured displacement, and its velocity: that of a quintic spline through it."""
    # The amount of smoothing is chosen by generalized cross validation, so that noise and quantization of the sensor do not
    # become velocity.
    # G. Wahba, *Spline Models for Observational Data* (SIAM 1990), chapter 4. D. Garcia, Comput. Stat. Data Anal. 54 (2010) 1167,
    # for the cosine transform.
    values, slopes, _ = _kept(displacement)
    return values, slopes / dt


def accelerated_motion(displacement: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """Return displacement and velocity of `smooth_motion`, and the acceleration."""
    values, slopes, bends = _kept(displacement)
    return values, slopes / dt, bends / dt**2


def _kept(displacement: Floats) -> tuple[Floats, Floats, Floats]:
    samples = np.ascontiguousarray(displacement, dtype=np.float64)
    # Cached, because every candidate needs the same records.
    key = sha256(samples.tobytes()).digest()
    with _cache_lock:
        found = _cache.get(key)
    if found is None:
        # Outside the lock: threads smooth different records side by side.
        found = _spline(samples)
        with _cache_lock:
            _cache[key] = found
            while len(_cache) > 1 and sum(kept[0].size for kept in _cache.values()) > _CACHED_SAMPLES:
                _cache.popitem(last=False)
    return found


def smoothed_noise(displacement: Floats, noise: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return the change of the smoothing spline of a displacement due to additional noise, with unchanged smoothing."""
    # Each cosine of the noise is smoothed by itself: a hundred times as fast as another spline, with the same result except at
    # the ends.
    n = noise.size
    weight = _penalty_kept(np.ascontiguousarray(displacement, dtype=np.float64).tobytes())
    lines = dct(noise, norm="ortho") / (1.0 + weight * _stiffness(n))
    slopes = -lines * np.pi * np.arange(n) / n
    # The sine transform begins with the first frequency, and its last frequency has no cosine.
    return idct(lines, norm="ortho"), idst(np.append(slopes[1:], 0.0), norm="ortho") / dt


@lru_cache(maxsize=64)
def _penalty_kept(content: bytes) -> float:
    samples = np.frombuffer(content, dtype=np.float64)
    return _penalty(continued(samples / (float(np.std(samples)) or 1.0), _BEYOND))


def _spline(samples: Floats) -> tuple[Floats, Floats, Floats]:
    scale = float(np.std(samples)) or 1.0
    # A smoothing spline is straight at its ends, unlike a motion, so its ends are moved beyond those of the record.
    longer = continued(samples / scale, _BEYOND)
    index, recorded = np.arange(longer.size, dtype=np.float64), slice(_BEYOND, -_BEYOND)
    spline = make_smoothing_spline(index, longer, lam=_penalty(longer))
    values = spline(index)
    # At 16 samples a cycle the first derivative of a cubic spline is wrong by 1e-4, the second by 1 %.
    through = make_interp_spline(index, values, k=5)
    slopes, bends = through.derivative(1)(index), through.derivative(2)(index)
    found = scale * values[recorded], scale * slopes[recorded], scale * bends[recorded]
    for array in found:
        array.setflags(write=False)
    return found


def _penalty(samples: Floats) -> float:
    """Return the weight of the squared curvature that generalized cross validation chooses."""
    # For equally spaced samples a cosine transform makes the smoothing spline diagonal (except at its ends), so that each trial
    # costs one sum; scipy's own choice takes seconds per record. The eigenvalues are those of the cubic spline.
    stiffness = _stiffness(samples.size)
    power = dct(samples - _end_slopes(samples), norm="ortho") ** 2

    def score(logarithm: float) -> float:
        removed = 1.0 - 1.0 / (1.0 + np.exp(logarithm) * stiffness)
        return float(np.log(power @ removed**2 + 1e-300) - 2.0 * np.log(np.sum(removed)))

    trials = np.linspace(*_PENALTIES, _TRIALS)
    best = int(np.argmin([score(trial) for trial in trials]))
    around = trials[max(best - 1, 0)], trials[min(best + 1, _TRIALS - 1)]
    return float(np.exp(minimize_scalar(score, bounds=around, method="bounded").x))


def _stiffness(n: int) -> Floats:
    """Return the squared curvature of each cosine of a cubic spline with unit power, shape (n,)."""
    phase = np.pi * np.arange(n) / n
    return np.asarray((2.0 - 2.0 * np.cos(phase)) ** 2 * 3.0 / (2.0 + np.cos(phase)))


def _end_slopes(samples: Floats) -> Floats:
    """Return the parabola with the samples' slopes at both ends; a cosine transform treats a nonzero slope there as a corner."""
    count = min(_END, samples.size)
    index = np.arange(count, dtype=np.float64)
    degree = min(3, count - 1)
    first = np.polyval(np.polyder(np.polyfit(index, samples[:count], degree)), -0.5)
    last = np.polyval(np.polyder(np.polyfit(index, samples[-count:], degree)), count - 0.5)
    middle = np.arange(samples.size) + 0.5
    return np.asarray(first * middle + 0.5 * (last - first) / samples.size * middle**2)
