"""The noise floor of an output: the error that no model can explain, and how it was found."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.noise.disturbance import Disturbance

Stretches = tuple[tuple[NDArray[np.float64], float], ...]
"""Pieces of noise alone, shape (n_samples,) each, with their sample time [s]."""


@dataclass(frozen=True)
class NoiseFloor:
    """Standard deviation of the error that no model can explain in an output, and how it was found.

    ``lower_bound`` means that only part of the noise was seen: colored noise and disturbances may exceed it. ``interval`` are its
    95 % limits; the upper one of a lower bound is the error of an adequate model, infinite without one. ``stretches`` are pieces
    of noise alone with their sample time [s], where the records have any; their spectrum is that of the noise. ``disturbance`` is
    the force that would cause the error of the diagnosed model above this noise, where the records show one.
    """

    output: str
    unit: str
    std: float
    method: str
    lower_bound: bool = False
    interval: tuple[float, float] = (0.0, math.inf)
    stretches: Stretches = field(default=(), compare=False, repr=False)
    disturbance: Disturbance | None = None
