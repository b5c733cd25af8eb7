"""Readings of delayed sensors from simulated outputs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rigsight.simulate.equations.structure import Structure, ahead_name
from rigsight.simulate.input_hold import HeldInput
from rigsight.simulate.model import at_parameters

Floats = NDArray[np.float64]


def as_measured(
    structure: Structure, p: NDArray[np.float64], out: NDArray[np.float64], held: HeldInput
) -> NDArray[np.float64]:
    """Shift outputs by the delays of their sensors; beyond its ends the record is continued with its rates there."""
    if not structure.is_shifted:
        return out
    n_samples = out.shape[0]
    visible = out[:, : len(structure.outputs)].copy()
    if n_samples < 2:
        return visible
    dt = held.interval * held.per_sample
    late = [(i, delay) for i, delay in enumerate(structure.shown_late) if delay is not None]
    for column, (output, delay) in enumerate(late, len(structure.outputs)):
        values = at_parameters(structure, delay, p)
        delays = np.broadcast_to(values, p.shape[1])
        visible[:, output] = _shifted(out[:, output], out[:, column] * dt, delays / dt)
    return visible


def _shifted(
    value: NDArray[np.float64], rise: NDArray[np.float64], delays: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return values, shape (n_samples, n_sets), delayed by numbers of samples (n_sets,); `rise` is their slope per sample."""
    shifted = np.empty_like(value)
    for i, delay in enumerate(delays):
        shifted[:, i] = _delayed(value[:, i].copy(), rise[:, i].copy(), float(delay))
    return shifted


def _delayed(value: NDArray[np.float64], rise: NDArray[np.float64], delay: float) -> NDArray[np.float64]:
    if not np.isfinite(delay):
        return np.full_like(value, np.nan)
    n_samples = value.size
    whole = int(np.clip(np.ceil(delay), -n_samples, n_samples))
    # A delay is the same fraction of every interval, so the Hermite polynomials are four numbers.
    s = whole - delay
    begin, end = max(whole, 0), min(n_samples, max(n_samples - 1 + whole, 0))
    left, right = slice(begin - whole, end - whole), slice(begin - whole + 1, end - whole + 1)
    delayed = np.empty_like(value)
    # The values of a set that diverges may overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        delayed[begin:end] = (
            (1.0 + 2.0 * s) * (1.0 - s) ** 2 * value[left]
            + s**2 * (3.0 - 2.0 * s) * value[right]
            + s * (1.0 - s) ** 2 * rise[left]
            - s**2 * (1.0 - s) * rise[right]
        )
        delayed[:begin] = value[0] + rise[0] * (np.arange(begin) - delay)
        delayed[end:] = value[-1] + rise[-1] * (np.arange(end, n_samples) - delay - (n_samples - 1))
    return delayed


def read_ahead(structure: Structure, held: HeldInput, p: Floats) -> tuple[HeldInput, Floats]:
    """Return input and parameters, with the measured motion of delayed sensors advanced by the delays of the first set."""
    delays = structure.observed_delays
    if not delays:
        return held, p
    own = p.copy()
    for sensor, delay in delays.items():
        by = float(at_parameters(structure, delay, p if p.ndim == 1 else p[:, 0]))
        if not np.isfinite(by):
            continue
        own[structure.names.index(ahead_name(sensor))] = by
        held = held.read_ahead(len(structure.rig.inputs) + structure.observed.index(sensor), by)
    return held, own
