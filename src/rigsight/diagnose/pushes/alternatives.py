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

from rigsight.diagnose.pushes.probes import motion_columns, signal_columns
from rigsight.diagnose.pushes.responses import Responses
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical
from rigsight.records.record import Floats
from rigsight.units import characteristic_value

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
        return _laws_of(responses, place, slopes(responses, place) if is_late else responses.simulated(place))
    laws = [law for law in (effect.torque, effect.spring, effect.deflection) if law is not None]
    read = {symbol for law in laws for symbol in law.free_symbols}
    found = []
    if canonical.v in read or effect.states:
        found.append(_laws_of(responses, place, slopes(responses, place)))
    if canonical.v not in read or effect.states:
        found.append(_laws_of(responses, place, responses.simulated(place)))
    return np.column_stack(found)


def alternatives(responses: Responses) -> Iterator[tuple[str, str, Floats]]:
    """Yield each possible cause of a residual in words, with its place and the responses of all readings, (n, n_columns)."""
    rig, course = responses.context.rig, _course(responses)
    for joint in motion_columns(rig):
        yield f"velocity of {joint}", joint, _laws_of(responses, joint, slopes(responses, joint))
        yield f"position of {joint}", joint, _laws_of(responses, joint, responses.simulated(joint))
        yield f"time, at {joint}", joint, _answers(responses, joint, course)
    for drive in signal_columns(rig):
        signals, size = responses.simulated(drive), _size(responses, drive)
        # A drive whose strength changes slowly over each record.
        fading = [[c * s / size for c, s in zip(own, signals, strict=True)] for own in course]
        yield f"signal of {drive}", drive, _laws_of(responses, drive, signals)
        yield f"change of {drive}", drive, _laws_of(responses, drive, slopes(responses, drive))
        yield f"time, at {drive}", drive, _answers(responses, drive, fading)
    sensors = [signal.name for signal in rig.outputs]
    for sensor in sensors:
        yield f"reading of {sensor}", sensor, _laws_of(responses, sensor, responses.simulated(sensor))
        yield f"change of {sensor}", sensor, _laws_of(responses, sensor, slopes(responses, sensor))
        yield f"drift of {sensor}", sensor, _answers(responses, sensor, course)
    if len(responses.records) > 1:
        for name in responses.free:
            yield f"{BY_RECORD}{name}", "", _by_record(responses, responses.to_parameter(name))
        for sensor in sensors:
            offset = _reading(responses, sensor, [np.ones(r.n_samples) for r in responses.records])
            yield f"{BY_RECORD}offset of {sensor}", sensor, _by_record(responses, offset)


def slopes(responses: Responses, place: str) -> list[Floats]:
    """Return the rate of the simulated motion, signal or reading at a place along each record."""
    return [np.gradient(s, r.dt) for s, r in zip(responses.simulated(place), responses.records, strict=True)]


def _laws_of(responses: Responses, place: str, signals: Sequence[Floats]) -> Floats:
    """Return the responses to a piecewise linear law of a signal at a place: a ramp from each of its corners on."""
    everything = np.concatenate(signals)
    knots = np.unique(np.quantile(everything, _KNOTS))
    scale = float(np.std(everything)) or 1.0
    return _answers(
        responses, place, [[np.maximum(s - knot, 0.0) / scale for s in signals] for knot in knots]
    )


def _course(responses: Responses) -> list[list[Floats]]:
    """Return slow changes over each record."""
    times = [np.linspace(0.0, np.pi, record.n_samples) for record in responses.records]
    return [[np.cos(n * t) for t in times] for n in range(1, _TIMES + 1)]


def _size(responses: Responses, place: str) -> float:
    """Return the typical force at a joint, or signal at a drive."""
    kind = "force" if place in motion_columns(responses.context.rig) else "input"
    return characteristic_value(f"{kind}@{place}", responses.scales)


def _answers(responses: Responses, place: str, signals: Sequence[list[Floats]]) -> Floats:
    """Return the responses to forces at a joint, to signals at a drive, or to errors of a sensor's reading."""
    if place in {signal.name for signal in responses.context.rig.outputs}:
        return np.column_stack([responses.stacked(_reading(responses, place, signal)) for signal in signals])
    size = _PUSH * _size(responses, place)
    return np.column_stack([responses.to_push(place, signal, size) for signal in signals])


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
