"""Alternatives that could cause the residual of a model: responses of its outputs to small perturbations, each of a single kind.

A force as a function of a joint's velocity or position, a drive as another function of its signal or its rate, another sensor
characteristic, a sensor that drifts, another change over time, or a parameter that differs from record to record. The functions
are piecewise linear. These are the alternatives of a score test, so nothing needs to be fitted for them.

References
----------
C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50, for score tests. L. Ljung, *System Identification* (Prentice Hall 1999), section
16.4, for judging extensions of a model by their correlation with its residual.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.pushes.answers import Answers
from rigsight.diagnose.pushes.probes import motion_columns, signal_columns
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

BY_RECORD = "record: "
"""Before what differs from record to record."""
_KNOTS = (0.02, 0.15, 0.35, 0.5, 0.65, 0.85, 0.98)
"""Quantiles of a signal at which the corners of a piecewise linear function of it stand."""
_PUSH = 1e-3
"""Size of a push in units of the typical force, signal or reading at its place: the answer is proportional."""
_TIMES = 4


def law_columns(answers: Answers, effect: Effect) -> Floats:
    """Return the responses to any other law of the signals that an effect reads, at its place; shape (n, n_columns)."""
    place = answers.context.rig.acts_at(effect)
    if effect.place in (Place.SENSOR, Place.ACTUATOR):
        # A static nonlinearity is not another form of a delay or lag, nor vice versa.
        is_late = bool(effect.states) or effect.delay is not None or effect.reading_delay is not None
        if effect.place is Place.SENSOR:
            return (_changes_of if is_late else _readings_of)(answers, place)
        return (_signal_changes_of if is_late else _signals_of)(answers, place)
    laws = [law for law in (effect.torque, effect.spring, effect.deflection) if law is not None]
    read = {symbol for law in laws for symbol in law.free_symbols}
    found = []
    if canonical.v in read or effect.states:
        found.append(_velocities_of(answers, place))
    if canonical.v not in read or effect.states:
        found.append(_positions_of(answers, place))
    return np.column_stack(found)


def alternatives(answers: Answers) -> Iterator[tuple[str, str, Floats]]:
    """Yield each possible cause of a residual in words, with its place and the responses of all readings, (n, n_columns)."""
    rig = answers.context.rig
    for joint in motion_columns(rig):
        yield f"velocity of {joint}", joint, _velocities_of(answers, joint)
        yield f"position of {joint}", joint, _positions_of(answers, joint)
        yield f"time, at {joint}", joint, _pushes(answers, joint, _course(answers), _force(answers, joint))
    for drive in signal_columns(rig):
        yield f"signal of {drive}", drive, _signals_of(answers, drive)
        yield f"change of {drive}", drive, _signal_changes_of(answers, drive)
        yield f"time, at {drive}", drive, _fading_of(answers, drive)
    for sensor in (s.name for s in rig.outputs):
        yield f"reading of {sensor}", sensor, _readings_of(answers, sensor)
        yield f"change of {sensor}", sensor, _changes_of(answers, sensor)
        yield f"drift of {sensor}", sensor, _shown(answers, sensor, _course(answers))
    if len(answers.records) > 1:
        for name in answers.free:
            yield f"{BY_RECORD}{name}", "", _by_record(answers, answers.to_parameter(name))
        for sensor in (s.name for s in rig.outputs):
            ones = [np.ones(r.n_samples) for r in answers.records]
            yield (
                f"{BY_RECORD}offset of {sensor}",
                sensor,
                _by_record(answers, _reading(answers, sensor, ones)),
            )


def _force(answers: Answers, joint: str) -> float:
    return _PUSH * characteristic_value(f"force@{joint}", answers.scales)


def _signal(answers: Answers, drive: str) -> float:
    return _PUSH * characteristic_value(f"input@{drive}", answers.scales)


def slopes(answers: Answers, place: str) -> list[Floats]:
    """Return the rate of the simulated motion, signal or reading at a place along each record."""
    return [np.gradient(s, r.dt) for s, r in zip(answers.simulated(place), answers.records, strict=True)]


def _velocities_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(slopes(answers, joint)), _force(answers, joint))


def _positions_of(answers: Answers, joint: str) -> Floats:
    return _pushes(answers, joint, _corners(answers.simulated(joint)), _force(answers, joint))


def _signals_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(answers.simulated(drive)), _signal(answers, drive))


def _signal_changes_of(answers: Answers, drive: str) -> Floats:
    return _pushes(answers, drive, _corners(slopes(answers, drive)), _signal(answers, drive))


def _fading_of(answers: Answers, drive: str) -> Floats:
    """Return what a drive whose strength changes slowly over each record would change."""
    size = characteristic_value(f"input@{drive}", answers.scales)
    faded = [
        [c * s / size for c, s in zip(course, answers.simulated(drive), strict=True)]
        for course in _course(answers)
    ]
    return _pushes(answers, drive, faded, _signal(answers, drive))


def _readings_of(answers: Answers, sensor: str) -> Floats:
    return _shown(answers, sensor, _corners(answers.simulated(sensor)))


def _changes_of(answers: Answers, sensor: str) -> Floats:
    return _shown(answers, sensor, _corners(slopes(answers, sensor)))


def _corners(signals: Sequence[Floats]) -> list[list[Floats]]:
    """Return the ramps of a piecewise linear function of a signal, for each record."""
    everything = np.concatenate(signals)
    knots = np.unique(np.quantile(everything, _KNOTS))
    scale = float(np.std(everything)) or 1.0
    return [[np.maximum(s - knot, 0.0) / scale for s in signals] for knot in knots]


def _course(answers: Answers) -> list[list[Floats]]:
    """Return slow changes over each record."""
    times = [np.linspace(0.0, np.pi, record.n_samples) for record in answers.records]
    return [[np.cos(n * t) for t in times] for n in range(1, _TIMES + 1)]


def _pushes(answers: Answers, place: str, signals: Sequence[list[Floats]], size: float) -> Floats:
    return np.column_stack([answers.to_push(place, signal, size) for signal in signals])


def _shown(answers: Answers, sensor: str, signals: Sequence[list[Floats]]) -> Floats:
    return np.column_stack([answers.stacked(_reading(answers, sensor, signal)) for signal in signals])


def _reading(answers: Answers, sensor: str, signals: Sequence[Floats]) -> list[Floats]:
    names = [s.name for s in answers.context.rig.outputs]
    found = []
    for signal in signals:
        part = np.zeros((signal.size, len(names)))
        part[:, names.index(sensor)] = signal
        found.append(part)
    return found


def _by_record(answers: Answers, parts: Sequence[Floats]) -> Floats:
    whole = answers.stacked(parts)
    columns = np.zeros((whole.size, len(parts)))
    for index, part in enumerate(answers.spans):
        columns[part, index] = whole[part]
    return columns
