"""Cutting records into windows with their own initial states, for rigs that drift in free run."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigsight.records.record import Record
from rigsight.rigs import Rig

WINDOW = " window "
"""Stands between a record's name and the number of its window."""
_PERIODS = 10.0
_MIN_SAMPLES = 100
_MAX_WINDOWS = 40


def window_length(rig: Rig, records: Sequence[Record]) -> float:
    """Return a window length [s] that holds several of the typical periods of the velocity.

    An axis without a spring integrates every error of the force twice; a window keeps that drift small against the motion.
    """
    periods = []
    for record in records:
        velocity = np.gradient(record[rig.outputs[0].name], record.dt)
        velocity -= np.mean(velocity)
        power = np.abs(np.fft.rfft(velocity)) ** 2
        frequency = np.fft.rfftfreq(velocity.size, record.dt)
        power[0] = 0.0
        periods.append(1.0 / max(float(np.sum(power * frequency) / np.sum(power)), 1e-12))
    dt = max(record.dt for record in records)
    longest = max(record.n_samples * record.dt for record in records)
    wished = max(_PERIODS * float(np.median(periods)), _MIN_SAMPLES * dt, longest / _MAX_WINDOWS)
    return min(wished, longest)


def cut(records: Sequence[Record], length: float | None) -> tuple[Record, ...]:
    """Return the records cut into windows of `length` [s], whole where it is None; a short rest joins the last window."""
    if length is None:
        return tuple(records)
    windows = []
    for record in records:
        count = max(1, int(record.n_samples * record.dt / length))
        edges = np.linspace(0, record.n_samples, count + 1).astype(int)
        for i, (start, stop) in enumerate(itertools.pairwise(edges)):
            part = record.slice(int(start), int(stop))
            windows.append(replace(part, name=f"{record.name}{WINDOW}{i + 1}"))
    return tuple(windows)
