"""Error of a simulated step in the seconds after the step.

The thesis (section 5.2.2) compares 180 to 184 s of a step of 0.6 A at 180 s, offsets before the step removed. Here: the first
four seconds from the step (or another length), each signal less its mean over up to five seconds before it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from rigsight.errors import InputError
from rigsight.metrics import rms
from rigsight.records import Record
from rigsight.records.record import Floats
from rigsight.records.signals import is_constant, roughness

DEFAULT_SECONDS = 4.0
_BEFORE = 5.0
"""Longest stretch before the step whose mean is the offset [s]."""
_LEAST_BEFORE = 2
_JUMP = 0.5
"""Share of the largest change between samples that counts as the step."""
_CHANCE = 1e-3
"""Probability that noise alone counts as a step."""


@dataclass(frozen=True)
class StepWindow:
    """Where a step is compared."""

    # Samples of which the offset is the mean, and samples that are compared.
    before: slice
    inside: slice

    def moved(self, samples: Floats) -> Floats:
        """Return the samples inside less the mean before, shape (n_inside,)."""
        return np.asarray(samples[self.inside] - np.mean(samples[self.before]))

    def error(self, measured: Floats, simulated: Floats) -> float:
        """Return the RMSE of two signals of shape (n_samples,), offsets removed."""
        return rms(self.moved(measured) - self.moved(simulated))

    def floor(self, std: float) -> float:
        """Return the RMSE that white noise of this standard deviation makes, that of the removed mean included."""
        return std * math.sqrt(1.0 + 1.0 / (self.before.stop - self.before.start))


def stepping_input(record: Record, sources: Sequence[str]) -> str:
    """Return the input that steps first; the first of all where none moves."""
    moving = [name for name in sources if not is_constant(record[name])]
    jumping = [name for name in moving if _exceeds_noise(record[name])]
    return min(jumping or moving, key=lambda name: _first_jump(record[name]), default=sources[0])


def _first_jump(samples: Floats) -> int:
    """Return the first sample after the first large change; 0 for a constant."""
    change = np.abs(np.diff(samples))
    largest = float(change.max(initial=0.0))
    return int(np.argmax(change >= _JUMP * largest)) + 1 if largest > 0.0 else 0


def _exceeds_noise(samples: Floats) -> bool:
    """Return True if noise as rough as that of the samples does not explain their largest change."""
    change = np.abs(np.diff(samples))
    # The difference of two samples has twice the variance of their noise; of all changes the largest is tested, to both sides.
    limit = math.sqrt(2.0) * norm.isf(_CHANCE / (2.0 * change.size)) * roughness(samples)
    return bool(np.max(change) > limit)


def step_window(record: Record, source: str, seconds: float = DEFAULT_SECONDS) -> StepWindow:
    """Return where the first step of a record is compared."""
    start = _first_jump(record[source])
    if start == 0:
        raise InputError(
            f"Record '{record.name}': the input '{source}' is constant from the first sample, so the offset before the step is "
            "unknown. Record some time at rest before the step."
        )
    first = max(0, start - round(_BEFORE / record.dt))
    if start - first < _LEAST_BEFORE:
        raise InputError(
            f"Record '{record.name}': the step comes {start * record.dt:.3g} s after the first sample, so the offset before it "
            f"is unknown. Record some time at rest before the step."
        )
    stop = min(record.n_samples, start + round(seconds / record.dt) + 1)
    return StepWindow(slice(first, start), slice(start, stop))
