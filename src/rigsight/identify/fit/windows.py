"""Over which stretches of its records is a model fitted: whole, windows with their own initial states, or followed?

A rig without a spring integrates every force error twice, so that a free run soon shows only the drift. Windows keep it small;
an observer is pulled towards the measured motion. A missing effect still shows within about the reciprocal of the observer's
bandwidth, while slower drift is removed. Internal states of effects are not corrected.

References
----------
D. G. Luenberger, IEEE Trans. Automatic Control 16 (1971) 596, for observers. L. Ljung, *System Identification* (Prentice Hall
1999), sections 4.3 and 7.4, for predictors of disturbed systems and for fits of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.simulate import compose
from rigsight.simulate.prescribed_motion import smooth_motion

_PERIODS = 10.0
"""Length of a window in typical periods of the velocity, if a rig drifts and no sensor measures its motion; an assumption."""
_SAMPLES = 100
"""Fewest samples of such a window."""
_MOST_WINDOWS = 40
"""Largest number of such windows per record, because each has its own initial state."""
_FEWEST_IN_CYCLES = 60
"""Fewest samples of a window counted in cycles."""
_ABOVE_NOISE = 3.0
"""Distance from the mean, in units of the noise, that a signal must reach for a zero crossing to count as motion."""
_DIED_AWAY = 0.99
"""Share of the sum of squared sample-to-sample changes of an output after which a free motion has decayed below a tenth."""
_FEWEST_IN_MOTION = 100
"""Fewest samples of a free motion that are kept."""


@dataclass(frozen=True)
class Observer:
    """Sensors that a model tracks while it is compared with records, and the bandwidth."""

    sensors: tuple[str, ...]  # names of sensors that read only the motion
    bandwidth: float  # angular frequency up to which the motion is tracked [rad/s]

    def following(self, records: Sequence[Record]) -> tuple[Record, ...]:
        """Return records that models follow while they are fitted to them."""
        return tuple(
            replace(record, observed={name: self.bandwidth for name in self.sensors if name in record})
            for record in records
        )


def observed_sensors(records: Sequence[Record]) -> frozenset[str]:
    """Return the sensors that models follow while they are fitted to records."""
    return frozenset(sensor for record in records for sensor in record.observed)


def followed_sensors(rig: Rig, records: Sequence[Record]) -> tuple[str, ...]:
    """Return the sensors that models can track in records: those that read only the motion."""
    return tuple(name for name in sensors_of_motion(rig) if any(name in record for record in records))


def sensors_of_motion(rig: Rig) -> tuple[str, ...]:
    """Return the sensors of a rig that read only its motion: coordinates and their rates."""
    structure = compose(rig)
    motion = structure.tree.motion
    moving = {*motion.coordinates, *motion.velocities}
    return tuple(
        sensor.name
        for sensor, reading in zip(rig.mechanism.sensors, structure.outputs, strict=True)
        if reading.free_symbols & moving and reading.free_symbols <= {*moving, *structure.parameter_symbols}
    )


@dataclass(frozen=True)
class Windowing:
    """How records are cut; without a length and without cycles they stay whole."""

    length: float | None = None  # length of a window [s]
    # Cycles of motion in a window, so that the fast part of a sweep is cut finer than the slow one.
    cycles: int | None = None
    # Noise floor of each output whose cycles count, the first that a record holds.
    noise: Mapping[str, float] = field(default_factory=dict)
    observer: Observer | None = None  # what models follow along whole records; None for a free run

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
        size = _ABOVE_NOISE * self.noise[output]
        sides = np.flatnonzero(np.abs(deviation) > size)
        above = deviation[sides] > 0.0
        crossings = sides[1:][above[1:] & ~above[:-1]]
        edges = [0]
        for crossing in map(int, crossings[cycles - 1 :: cycles]):
            if min(crossing - edges[-1], record.n_samples - crossing) >= _FEWEST_IN_CYCLES:
                edges.append(crossing)
        return [*edges, record.n_samples]


def readings(records: Sequence[Record], sensor: str) -> dict[str, Floats]:
    """Return what a sensor shows in each record that holds it, windows joined, by the name of the record."""
    # If the sensor has its own offset in each record, its mean is removed.
    parts: dict[str, list[Floats]] = {}
    for record in records:
        if sensor in record:
            parts.setdefault(record.origin, []).append(record[sensor])
    free = any(sensor in record.free_offsets for record in records)
    joined = {name: np.concatenate(part) for name, part in parts.items()}
    return {name: whole - np.mean(whole) for name, whole in joined.items()} if free else joined


def leading_output(rig: Rig, records: Sequence[Record]) -> str:
    """Return the output that defines cycles and excited stretches: the first that most records contain, preferably of motion."""
    outputs = [signal.name for signal in rig.outputs]
    return max(
        followed_sensors(rig, records) or outputs, key=lambda name: sum(name in record for record in records)
    )


def shown_by(rig: Rig, records: Sequence[Record]) -> list[str]:
    """Return for each record the output whose motion tells its lively stretches: the leading one where it holds that."""
    leading = leading_output(rig, records)
    return [leading if leading in record else leading_output(rig, [record]) for record in records]


def window_length(rig: Rig, records: Sequence[Record]) -> float:
    """Return a window length [s] that holds several of the typical periods of the velocity."""
    # An axis without a spring integrates every force error twice; a window keeps that drift small compared with the motion.
    dt = max(record.dt for record in records)
    longest = max(record.n_samples * record.dt for record in records)
    wished = max(_PERIODS * typical_period(rig, records), _SAMPLES * dt, longest / _MOST_WINDOWS)
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
    """Return the records cut into windows of `length` [s], whole where it is None; a short rest joins the last window."""
    # A window holds one sample at least.
    if length is None:
        return tuple(records)
    windows: list[Record] = []
    for record in records:
        count = min(max(1, int(record.n_samples * record.dt / length)), record.n_samples)
        edges = np.linspace(0, record.n_samples, count + 1).astype(int)
        windows += _at(record, edges.tolist())
    return tuple(windows)


def pieces(record: Record, count: int) -> list[Record]:
    """Return a record in about equally long pieces; fewer than `count` where it has fewer samples."""
    edges = np.unique(np.linspace(0, record.n_samples, count + 1).astype(int))
    return [record.slice(int(start), int(stop)) for start, stop in itertools.pairwise(edges)]


def _at(record: Record, edges: Sequence[int]) -> list[Record]:
    return [
        replace(record.slice(start, stop), name=f"{record.name} window {i}", window_of=record.origin)
        for i, (start, stop) in enumerate(itertools.pairwise(edges), start=1)
    ]


def until_rest(records: Sequence[Record], rig: Rig) -> tuple[Record, ...]:
    """Return the records, those of a free motion only until it has decayed."""
    # The position at which friction stops a mass changes in jumps with the parameters: a fit that includes the following rest,
    # which may be long, would not leave its start.
    cut_off = []
    for record, output in zip(records, shown_by(rig, records), strict=True):
        stop = record.n_samples
        if all(is_constant(record[signal.name]) for signal in rig.inputs):
            energy = np.cumsum(np.diff(record[output]) ** 2)
            stop = max(_FEWEST_IN_MOTION, int(np.searchsorted(energy, _DIED_AWAY * energy[-1])) + 1)
        cut_off.append(record.slice(0, min(stop, record.n_samples)))
    return tuple(cut_off)


def liveliest(records: Sequence[Record], rig: Rig, n_samples: int) -> tuple[Record, ...]:
    """Return the most excited stretch of each record, together about `n_samples` long."""
    shown = zip(records, shown_by(rig, records), strict=True)
    return strongest(
        records, [(record[output] - np.mean(record[output])) ** 2 for record, output in shown], n_samples
    )


def strongest(records: Sequence[Record], powers: Sequence[Floats], n_samples: int) -> tuple[Record, ...]:
    """Return the stretch of each record with the largest sum of a power, shape (n_samples,), together about `n_samples` long."""
    share = max(500, n_samples // max(1, len(records)))
    stretches = []
    for record, power in zip(records, powers, strict=True):
        if record.n_samples <= share:
            stretches.append(record)
            continue
        energy = np.cumsum(power)
        start = int(np.argmax(energy[share:] - energy[:-share]))
        stretches.append(record.slice(start, start + share))
    return tuple(stretches)
