"""Size of the disturbance force, estimated from the residual of the completed model.

A force w in addition to the drive moves one mass by ``H w`` with ``1 / H = k + w0^2 m - m W^2 + j W (d + sqrt(2) w0 m)``, w0
being the bandwidth of an observer and 0 in a free run. The residual above the sensor noise, divided by H, is the spectrum of w.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from rigsight.diagnose.policy import NOTES
from rigsight.records.record import Record
from rigsight.rigs import Rig, evaluated

Floats = NDArray[np.float64]

_SMOOTHED = 9
"""Lines of a spectrum that are averaged."""


@dataclass(frozen=True)
class Disturbance:
    """A disturbance force in addition to the drive."""

    std: float  # its standard deviation
    unit: str  # of the force
    below: float  # angular frequency up to which it stands above the sensor's noise [rad/s]


def disturbance(
    rig: Rig,
    values: Mapping[str, float],
    records: Sequence[Record],
    remainder: Sequence[Floats],
    noise: float,
    bandwidth: float | None,
) -> Disturbance | None:
    """Return the force that would cause the residual of a model; None except for one driven mass, and where noise hides it."""
    if not (rig.has_one_motion and rig.is_driven):
        return None
    motion, follows = rig.motion, bandwidth or 0.0
    variances, highest = [], 0.0
    for record, residual in zip(records, remainder, strict=True):
        own = {**values, **record.constants}
        inertia, damping, stiffness = (
            evaluated(part, own) for part in (motion.inertia, motion.damping, motion.stiffness)
        )
        omega, power = _power(residual, record.dt)
        covered = np.flatnonzero(power < NOTES.disturbance_above * noise**2)
        stop = int(covered[0]) if covered.size else omega.size
        omega, power = omega[:stop], power[:stop]
        real = stiffness + follows**2 * inertia - inertia * omega**2
        imaginary = omega * (damping + np.sqrt(2.0) * follows * inertia)
        force = (real**2 + imaginary**2) * (power - noise**2)
        variances.append((2.0 * float(np.sum(force)) / residual.size, residual.size))
        highest = max(highest, float(omega[-1]) if stop else 0.0)
    total = sum(size for _, size in variances)
    variance = sum(single * size for single, size in variances) / total
    return Disturbance(float(np.sqrt(variance)), rig.units["force"], highest) if variance > 0.0 else None


def _power(residual: Floats, dt: float) -> tuple[Floats, Floats]:
    """Return angular frequencies above zero and the smoothed power of each line; white noise has its variance at each."""
    window = np.hanning(residual.size)
    lines = np.abs(np.fft.rfft((residual - np.mean(residual)) * window)) ** 2 / np.sum(window**2)
    omega = 2.0 * np.pi * np.fft.rfftfreq(residual.size, dt)
    return np.asarray(omega[1:]), uniform_filter1d(lines[1:], _SMOOTHED, mode="nearest")
