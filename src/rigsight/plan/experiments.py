"""Experiments that may separate rivals: waveforms about an operating point, each scaled until it reaches a limit of the user.

References
----------
R. Pintelon and J. Schoukens, *System Identification* (IEEE Press 2012), chapter 5, for sweeps and multisines.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.signal import sawtooth

from rigsight.errors import InputError, nearest
from rigsight.excitation import log_sweep, multisine, multisine_lines
from rigsight.records import Floats, Record
from rigsight.rigs import Rig

SHARES = (1.0, 0.3, 0.1)
"""Amplitudes that are tried, as shares of the largest that the limits allow."""
_REST = 200
"""Samples of rest before the excitation, or a tenth of the record if that is less: they show the noise and the state of rest."""
_BAND = (0.1, 5.0)
"""Limits of the excited band in units of the typical frequency of the rig."""
_PERIODS = 3.0
"""Fewest periods of the lowest frequency."""
_LINES = 30
"""Most lines of a multisine."""
_BELOW_NYQUIST = 0.4
_REALIZATIONS = 2
_CHANGED = ", with lines added"
_LINE_SIZES = (0.1, 0.5)
"""Range of the amplitude of a line that a change adds, in units of the largest sample."""


@dataclass(frozen=True)
class Limit:
    """The largest absolute value of a signal, or of its rate."""

    signal: str
    value: float  # in the unit of the signal, of a rate per second
    is_rate: bool = False

    @property
    def name(self) -> str:
        """Name as it is given: ``x`` or ``d(x)``."""
        return f"d({self.signal})" if self.is_rate else self.signal

    def reached(self, record: Record) -> float:
        """Return the largest absolute value in a record."""
        samples = record[self.signal]
        if self.is_rate:
            samples = np.diff(samples) / record.dt
        return float(np.max(np.abs(samples)))


def read_limits(rig: Rig, asked: Sequence[str]) -> tuple[Limit, ...]:
    """Return the limits that texts such as ``x=0.02`` or ``d(x)=0.5`` set, by input or sensor."""
    known = {
        limit.name: limit
        for signal in (*rig.inputs, *rig.outputs)
        for limit in (Limit(signal.name, 0.0), Limit(signal.name, 0.0, is_rate=True))
    }
    constants = [constant.name for constant in rig.constants]
    found: dict[str, Limit] = {}
    for text, name, value in _read(asked):
        if name in constants:
            continue
        if name not in known:
            allowed = (*known, *constants)
            raise InputError(
                f"--limit {text}: '{name}' is unknown.{nearest(name, allowed)} Allowed: {', '.join(allowed)}, each as NAME=VALUE."
            )
        if name in found:
            raise InputError(f"--limit {text}: '{name}' is limited twice; give one value.")
        if not 0.0 < value < math.inf:
            raise InputError(f"--limit {text}: the value must be a positive number.")
        found[name] = Limit(known[name].signal, value, known[name].is_rate)
    return tuple(found.values())


def read_payloads(rig: Rig, asked: Sequence[str]) -> tuple[Mapping[str, float], ...]:
    """Return the values that texts such as ``m=2`` give constants of a rig."""
    constants = {constant.name: constant for constant in rig.constants}
    return tuple({name: constants[name].check(value)} for _, name, value in _read(asked) if name in constants)


def _read(asked: Sequence[str]) -> Iterator[tuple[str, str, float]]:
    """Yield each text with its name and its value, which is NaN where it is no number."""
    for text in asked:
        name, _, number = (part.strip() for part in text.partition("="))
        try:
            yield text, name, float(number)
        except ValueError:
            yield text, name, math.nan


def with_recorded_range(limits: Sequence[Limit], rig: Rig, records: Sequence[Record]) -> tuple[Limit, ...]:
    """Return the limits, with the largest recorded value for each input that has none."""
    limited = {limit.signal for limit in limits if not limit.is_rate}
    added = []
    for signal in rig.inputs:
        if signal.name not in limited:
            largest = max(Limit(signal.name, 0.0).reached(record) for record in records)
            if largest > 0.0:
                added.append(Limit(signal.name, largest))
    return (*limits, *added)


def use_of(limits: Sequence[Limit], record: Record) -> float:
    """Return the largest share of a limit that a record uses."""
    return max((limit.reached(record) / limit.value for limit in limits), default=0.0)


@dataclass(frozen=True, eq=False)
class Experiment:
    """Inputs to play."""

    what: str  # in words
    # Excitation of each moved input, shape (n_samples,); the largest sample is one.
    shapes: Mapping[str, Floats]
    constants: Mapping[str, float] = field(default_factory=dict)  # such as a payload
    amplitude: float = 1.0  # of the shapes, in units of the room that the limits leave an input

    def with_amplitude(self, amplitude: float) -> Experiment:
        """Return the same with another amplitude."""
        return replace(self, amplitude=amplitude)


@dataclass(frozen=True, eq=False)
class Bench:
    """What is common to all experiments: sample time, duration, operating point, room of each input."""

    like: Record  # a record of the campaign, with its sample time, hold and units
    n_samples: int
    middles: Mapping[str, float]  # operating point of each input
    room: Mapping[str, float]  # largest deviation of each input from it
    omega: float  # typical angular frequency of the rig [rad/s]

    @classmethod
    def of(
        cls, rig: Rig, records: Sequence[Record], limits: Sequence[Limit], n_samples: int, omega: float
    ) -> Bench:
        """Return the bench of a rig whose records show its operating point."""
        largest = {limit.signal: limit.value for limit in limits if not limit.is_rate}
        middles, room = {}, {}
        for signal in rig.inputs:
            middle = float(np.median(np.concatenate([record[signal.name] for record in records])))
            middles[signal.name] = middle
            if signal.name in largest:
                room[signal.name] = largest[signal.name] - abs(middle)
                if room[signal.name] < 0.0:
                    raise InputError(
                        f"--limit {signal.name}={largest[signal.name]:g}: the records are about {signal.name} = {middle:g}, "
                        "which the limit excludes. Give a larger limit."
                    )
        if not any(room.values()):
            raise InputError(
                f"The inputs ({', '.join(middles)}) rest in all records. Give a limit for one, such as "
                f"--limit {next(iter(middles))}=1."
            )
        return cls(records[0], n_samples, middles, room, omega)

    @property
    def band(self) -> tuple[float, float]:
        """Lowest and highest angular frequency that is excited [rad/s]."""
        highest = _BELOW_NYQUIST * math.pi / self.like.dt
        lowest = max(_BAND[0] * self.omega, 2.0 * math.pi * _PERIODS / (self.n_samples * self.like.dt))
        lowest, highest = min(lowest, 0.5 * highest), min(_BAND[1] * self.omega, highest)
        return lowest, max(highest, 1.5 * lowest)

    def record(self, experiment: Experiment) -> Record:
        """Return the inputs of an experiment as a record to be simulated."""
        moved = {
            name: middle
            + experiment.amplitude
            * self.room.get(name, 0.0)
            * experiment.shapes.get(name, np.zeros(self.n_samples))
            for name, middle in self.middles.items()
        }
        return Record(
            "plan",
            self.like.dt,
            moved,
            self.like.units,
            hold=self.like.hold,
            constants=experiment.constants,
            free_offsets=self.like.free_offsets,
        )

    def library(
        self, constants: Sequence[Mapping[str, float]], rng: np.random.Generator
    ) -> Iterator[Experiment]:
        """Yield the experiments that are tried first: each input alone, then all of them together."""
        moved = [name for name, room in self.room.items() if room > 0.0]
        groups = [(name,) for name in moved] + ([tuple(moved)] if len(moved) > 1 else [])
        for own in constants:
            for group in groups:
                drawn = [dict(self._waveforms(rng)) for _ in group]
                for what in drawn[0]:
                    shapes = {name: shape[what] for name, shape in zip(group, drawn, strict=True)}
                    yield Experiment(f"{what} of {' and '.join(group)}", shapes, own)

    def _waveforms(self, rng: np.random.Generator) -> Iterator[tuple[str, Floats]]:
        dt, omega, (lowest, highest) = self.like.dt, self.omega, self.band
        rest = min(_REST, self.n_samples // 10)
        n = self.n_samples - rest
        t = dt * np.arange(n, dtype=np.float64)
        growing = np.linspace(0.0, 1.0, n)

        def after_rest(samples: Floats) -> Floats:
            return np.concatenate([np.zeros(rest), samples / np.max(np.abs(samples))])

        middle = float(np.clip(omega, lowest, highest))
        yield "sweep", after_rest(log_sweep(t, 1.0, lowest, highest))
        yield "growing sweep", after_rest(growing * log_sweep(t, 1.0, lowest, highest))
        yield "slow sine", after_rest(np.sin(lowest * t))
        yield "slow triangle", after_rest(sawtooth(lowest * t + 0.5 * np.pi, 0.5))
        yield "growing sine", after_rest(growing * np.sin(middle * t))
        held = max(1, round(2.0 * math.pi / (middle * dt)))
        for number in range(1, _REALIZATIONS + 1):
            levels = rng.uniform(-1.0, 1.0, n // held + 1)
            yield f"steps {number}", after_rest(np.repeat(levels, held)[:n])
            for name, band in (
                ("slow", (lowest, max(middle, 1.5 * lowest))),
                ("wide", (lowest, highest)),
                ("fast", (min(middle, 0.67 * highest), highest)),
            ):
                wave = self._multisine(n, band, rng)
                yield f"{name} multisine {number}", after_rest(wave)
                if name == "wide":
                    yield f"multisine {number} above the middle", after_rest(0.5 + 0.5 * wave)
                    yield f"multisine {number} below the middle", after_rest(0.5 * wave - 0.5)

    def _multisine(self, n: int, band: tuple[float, float], rng: np.random.Generator) -> Floats:
        lines = multisine_lines(n, self.like.dt, *band)
        chosen = np.unique(np.round(np.geomspace(1, lines.size, min(_LINES, lines.size))).astype(int)) - 1
        wave = multisine(n, self.like.dt, lines[chosen], 1.0, rng, crest_iterations=5).samples
        return np.asarray(wave / np.max(np.abs(wave)))

    def changed(self, experiment: Experiment, rng: np.random.Generator) -> Experiment:
        """Return an experiment with one line of drawn frequency, amplitude and phase added to one input."""
        name = str(rng.choice(list(experiment.shapes)))
        rest = min(_REST, self.n_samples // 10)
        t = self.like.dt * np.arange(self.n_samples - rest)
        omega = math.exp(rng.uniform(*np.log(self.band)))
        size = math.exp(rng.uniform(*np.log(_LINE_SIZES)))
        line = size * np.cos(omega * t + rng.uniform(0.0, 2.0 * math.pi))
        shape = experiment.shapes[name].copy()
        shape[rest:] += line
        what = experiment.what.removesuffix(_CHANGED) + _CHANGED
        return replace(
            experiment, what=what, shapes={**experiment.shapes, name: shape / np.max(np.abs(shape))}
        )
