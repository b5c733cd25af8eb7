"""Cutting records into windows with their own initial states, for rigs that drift or move too sensitively."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.observer import Observer, sensors_of_motion
from rigsight.diagnose.policy import HORIZON, VERDICT
from rigsight.records.record import Record
from rigsight.rigs import Rig
from rigsight.simulate.prescribed_motion import smooth_motion


@dataclass(frozen=True)
class Windowing:
    """How records are cut; without a length and without cycles they stay whole."""

    length: float | None = None  # length of a window [s]
    # Cycles of motion in a window, so that the fast part of a sweep is cut finer than the slow one.
    cycles: int | None = None
    # Noise floor of each output whose cycles count, the first that a record holds.
    noise: Mapping[str, float] = field(default_factory=dict)
    observer: Observer | None = None  # what models follow along whole records; None for a free run

    @classmethod
    def by_cycles(cls, noise: Mapping[str, float]) -> Windowing:
        """Return windows of a few cycles of the first of these outputs that a record holds, with their noise floors."""
        return cls(cycles=VERDICT.window_cycles, noise=noise)

    @property
    def whole(self) -> bool:
        """True where records are not cut."""
        return self.length is None and self.cycles is None and self.observer is None

    @property
    def bandwidth(self) -> float | None:
        """Angular frequency [rad/s] up to which models follow the measured motion; None where they do not."""
        return None if self.observer is None else self.observer.bandwidth

    def cut(self, records: Sequence[Record]) -> tuple[Record, ...]:
        """Return the records to compare with: windows in order, which join to the records, or those that are followed."""
        if self.observer is not None:
            return self.observer.following(records)
        if self.cycles is None:
            return cut(records, self.length)
        windows: list[Record] = []
        for record in records:
            windows += _at(record, self._edges(record, self.cycles))
        return tuple(windows)

    def _edges(self, record: Record, cycles: int) -> list[int]:
        output = next(name for name in self.noise if name in record)
        deviation = record[output] - np.median(record[output])
        size = HORIZON.crossing_above_noise * self.noise[output]
        sides = np.flatnonzero(np.abs(deviation) > size)
        above = deviation[sides] > 0.0
        crossings = sides[1:][above[1:] & ~above[:-1]]
        edges = [0]
        for crossing in map(int, crossings[cycles - 1 :: cycles]):
            if min(crossing - edges[-1], record.n_samples - crossing) >= HORIZON.fewest_window_samples:
                edges.append(crossing)
        return [*edges, record.n_samples]


def readings(records: Sequence[Record], sensor: str) -> dict[str, NDArray[np.float64]]:
    """Return what a sensor shows in each record that holds it, windows joined, by the name of the record.

    If the sensor has its own offset in each record, its mean is removed.
    """
    parts: dict[str, list[NDArray[np.float64]]] = {}
    for record in records:
        if sensor in record:
            parts.setdefault(record.origin, []).append(record[sensor])
    free = any(sensor in record.free_offsets for record in records)
    joined = {name: np.concatenate(part) for name, part in parts.items()}
    return {name: whole - np.mean(whole) for name, whole in joined.items()} if free else joined


def leading_output(rig: Rig, records: Sequence[Record]) -> str:
    """Return the output that defines cycles and excited stretches: the first that most records contain, preferably of motion."""
    outputs = [signal.name for signal in rig.outputs]
    of_motion = [name for name in sensors_of_motion(rig) if any(name in record for record in records)]
    return max(of_motion or outputs, key=lambda name: sum(name in record for record in records))


def shown_by(rig: Rig, records: Sequence[Record]) -> list[str]:
    """Return for each record the output whose motion tells its lively stretches: the leading one where it holds that."""
    leading = leading_output(rig, records)
    return [leading if leading in record else leading_output(rig, [record]) for record in records]


def window_length(rig: Rig, records: Sequence[Record]) -> float:
    """Return a window length [s] that holds several of the typical periods of the velocity.

    An axis without a spring integrates every force error twice; a window keeps that drift small compared with the motion.
    """
    dt = max(record.dt for record in records)
    longest = max(record.n_samples * record.dt for record in records)
    wished = max(
        HORIZON.window_periods * typical_period(rig, records),
        HORIZON.window_samples * dt,
        longest / HORIZON.most_windows,
    )
    return min(wished, longest)


def typical_period(rig: Rig, records: Sequence[Record]) -> float:
    """Return the reciprocal of the middle frequency of the velocity [s], of which smoothing leaves the noise out."""
    periods = []
    for record, output in zip(records, shown_by(rig, records), strict=True):
        velocity = smooth_motion(record[output], record.dt)[1]
        velocity = velocity - np.mean(velocity)
        power = np.abs(np.fft.rfft(velocity)) ** 2
        frequency = np.fft.rfftfreq(velocity.size, record.dt)
        power[0] = 0.0
        periods.append(1.0 / max(float(np.sum(power * frequency) / np.sum(power)), 1e-12))
    return float(np.median(periods))


def cut(records: Sequence[Record], length: float | None) -> tuple[Record, ...]:
    """Return the records cut into windows of `length` [s], whole where it is None; a short rest joins the last window.

    A window holds one sample at least.
    """
    if length is None:
        return tuple(records)
    windows: list[Record] = []
    for record in records:
        count = min(max(1, int(record.n_samples * record.dt / length)), record.n_samples)
        edges = np.linspace(0, record.n_samples, count + 1).astype(int)
        windows += _at(record, edges.tolist())
    return tuple(windows)


def _at(record: Record, edges: Sequence[int]) -> list[Record]:
    return [
        replace(record.slice(start, stop), name=f"{record.name} window {i}", window_of=record.origin)
        for i, (start, stop) in enumerate(itertools.pairwise(edges), start=1)
    ]
