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

from rigsight.diagnose.pushes.probes import motion_columns, signal_columns
from rigsight.diagnose.pushes.responses import Responses
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


def law_columns(responses: Responses, effect: Effect) -> Floats:
    """Return the responses to any other law of the signals that an effect reads, at its place; shape (n, n_columns)."""
    place = responses.context.rig.acts_at(effect)
    if effect.place in (Place.SENSOR, Place.ACTUATOR, Place.CONTROLLER):
        # A static nonlinearity is not another form of a delay or lag, nor vice versa.
        delays = (effect.delay, effect.reading_delay, effect.command_delay)
        is_late = bool(effect.states) or any(delay is not None for delay in delays)
        if effect.place is Place.SENSOR:
            return (_changes_of if is_late else _readings_of)(responses, place)
        return (_signal_changes_of if is_late else _signals_of)(responses, place)
    laws = [law for law in (effect.torque, effect.spring, effect.deflection) if law is not None]
    read = {symbol for law in laws for symbol in law.free_symbols}
    found = []
    if canonical.v in read or effect.states:
        found.append(_velocities_of(responses, place))
    if canonical.v not in read or effect.states:
        found.append(_positions_of(responses, place))
    return np.column_stack(found)


def alternatives(responses: Responses) -> Iterator[tuple[str, str, Floats]]:
    """Yield each possible cause of a residual in words, with its place and the responses of all readings, (n, n_columns)."""
    rig = responses.context.rig
    for joint in motion_columns(rig):
        yield f"velocity of {joint}", joint, _velocities_of(responses, joint)
        yield f"position of {joint}", joint, _positions_of(responses, joint)
        yield (
            f"time, at {joint}",
            joint,
            _pushes(responses, joint, _course(responses), _force(responses, joint)),
        )
    for drive in signal_columns(rig):
        yield f"signal of {drive}", drive, _signals_of(responses, drive)
        yield f"change of {drive}", drive, _signal_changes_of(responses, drive)
        yield f"time, at {drive}", drive, _fading_of(responses, drive)
    for sensor in (s.name for s in rig.outputs):
        yield f"reading of {sensor}", sensor, _readings_of(responses, sensor)
        yield f"change of {sensor}", sensor, _changes_of(responses, sensor)
        yield f"drift of {sensor}", sensor, _shown(responses, sensor, _course(responses))
    if len(responses.records) > 1:
        for name in responses.free:
            yield f"{BY_RECORD}{name}", "", _by_record(responses, responses.to_parameter(name))
        for sensor in (s.name for s in rig.outputs):
            ones = [np.ones(r.n_samples) for r in responses.records]
            yield (
                f"{BY_RECORD}offset of {sensor}",
                sensor,
                _by_record(responses, _reading(responses, sensor, ones)),
            )


def _force(responses: Responses, joint: str) -> float:
    return _PUSH * characteristic_value(f"force@{joint}", responses.scales)


def _signal(responses: Responses, drive: str) -> float:
    return _PUSH * characteristic_value(f"input@{drive}", responses.scales)


def slopes(responses: Responses, place: str) -> list[Floats]:
    """Return the rate of the simulated motion, signal or reading at a place along each record."""
    return [np.gradient(s, r.dt) for s, r in zip(responses.simulated(place), responses.records, strict=True)]


def _velocities_of(responses: Responses, joint: str) -> Floats:
    return _pushes(responses, joint, _corners(slopes(responses, joint)), _force(responses, joint))


def _positions_of(responses: Responses, joint: str) -> Floats:
    return _pushes(responses, joint, _corners(responses.simulated(joint)), _force(responses, joint))


def _signals_of(responses: Responses, drive: str) -> Floats:
    return _pushes(responses, drive, _corners(responses.simulated(drive)), _signal(responses, drive))


def _signal_changes_of(responses: Responses, drive: str) -> Floats:
    return _pushes(responses, drive, _corners(slopes(responses, drive)), _signal(responses, drive))


def _fading_of(responses: Responses, drive: str) -> Floats:
    """Return what a drive whose strength changes slowly over each record would change."""
    size = characteristic_value(f"input@{drive}", responses.scales)
    faded = [
        [c * s / size for c, s in zip(course, responses.simulated(drive), strict=True)]
        for course in _course(responses)
    ]
    return _pushes(responses, drive, faded, _signal(responses, drive))


def _readings_of(responses: Responses, sensor: str) -> Floats:
    return _shown(responses, sensor, _corners(responses.simulated(sensor)))


def _changes_of(responses: Responses, sensor: str) -> Floats:
    return _shown(responses, sensor, _corners(slopes(responses, sensor)))


def _corners(signals: Sequence[Floats]) -> list[list[Floats]]:
    """Return the ramps of a piecewise linear function of a signal, for each record."""
    everything = np.concatenate(signals)
    knots = np.unique(np.quantile(everything, _KNOTS))
    scale = float(np.std(everything)) or 1.0
    return [[np.maximum(s - knot, 0.0) / scale for s in signals] for knot in knots]


def _course(responses: Responses) -> list[list[Floats]]:
    """Return slow changes over each record."""
    times = [np.linspace(0.0, np.pi, record.n_samples) for record in responses.records]
    return [[np.cos(n * t) for t in times] for n in range(1, _TIMES + 1)]


def _pushes(responses: Responses, place: str, signals: Sequence[list[Floats]], size: float) -> Floats:
    return np.column_stack([responses.to_push(place, signal, size) for signal in signals])


def _shown(responses: Responses, sensor: str, signals: Sequence[list[Floats]]) -> Floats:
    return np.column_stack([responses.stacked(_reading(responses, sensor, signal)) for signal in signals])


def _reading(responses: Responses, sensor: str, signals: Sequence[Floats]) -> list[Floats]:
    names = [s.name for s in responses.context.rig.outputs]
    found = []
    for signal in signals:
        part = np.zeros((signal.size, len(names)))
        part[:, names.index(sensor)] = signal
        found.append(part)
    return found


def _by_record(responses: Responses, parts: Sequence[Floats]) -> Floats:
    whole = responses.stacked(parts)
    columns = np.zeros((whole.size, len(parts)))
    for index, part in enumerate(responses.spans):
        columns[part, index] = whole[part]
    return columns
