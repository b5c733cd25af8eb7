"""Initial states of a record: estimates from its first samples, as start values of a fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import sympy as sp
from scipy.optimize import OptimizeResult, least_squares

from rigsight.effects import Place, State
from rigsight.identify.rig_equations import RigEquations, equations_of
from rigsight.records.record import Floats, Record
from rigsight.records.signals import is_constant, size_of_signal
from rigsight.rigs import Rig, evaluated
from rigsight.simulate import Structure
from rigsight.simulate.equations.derivatives import declared_start
from rigsight.units import parse_dimension

_FIRST_SAMPLES = 7
_RESTING = 1e-3
"""Share of its range within which an input counts as resting."""
_PULL = 1e-3
"""Weight of the equilibrium relative to that of a sensor: it determines only what the sensors do not."""
_BENT = 5
"""Number of samples from which a path that is bent can be told from noise."""
_SURELY = 3.0
"""Curvature of a path in standard deviations from which it is bent."""
_MOST_EVALUATIONS = 100
_DIFFERENCE = float(np.sqrt(np.finfo(float).eps))
"""Step of a difference, relative to numbers above one."""
_HUGE = 1e6
_OF_SIGNALS = (Place.ACTUATOR, Place.CONTROLLER, Place.SENSOR)
_CONTROL = ("error", "command")
_known: WeakKeyDictionary[Record, dict[tuple[RigEquations, int | None, bytes], Floats]] = WeakKeyDictionary()


def first_state(structure: Structure, record: Record, values: Mapping[str, float]) -> Floats:
    """Return an estimate of the initial state from the first samples: readings and their slopes, empty memory, settled lags."""
    rig = structure.rig
    if rig.has_one_motion:
        return _of_one_motion(structure, record, values)
    equations = equations_of(rig)
    return _with_effects(structure, record, equations, values, rig_state(equations, record, values))


def state_at_rest(structure: Structure, record: Record, guess: Floats, values: Mapping[str, float]) -> Floats:
    """Return the estimate for a rig at rest, shape (n_states,), from the mean readings before the inputs change."""
    rig = structure.rig
    state = guess.copy()
    if not rig.is_driven:
        return state
    count = _resting_samples(record, [signal.name for signal in rig.inputs])
    if not rig.has_one_motion:
        equations = equations_of(rig)
        own = rig_state(equations, record, values, resting=count)
        state[: own.size] = own
        return state
    offsets = guess[guess.size - len(structure.offsets) :]
    record = _without(record, dict(zip(structure.offsets, offsets, strict=True)))
    state[0], state[1] = float(np.mean(record[rig.outputs[0].name][:count])), 0.0
    for i, name in enumerate(structure.state_names):
        if name in record and i > 1:
            state[i] = float(np.mean(record[name][:count]))
    return state


def moves_freely(rig: Rig, record: Record) -> bool:
    """Return True for a record without changing inputs, of a rig whose motion is not prescribed."""
    return rig.is_driven and all(is_constant(record[signal.name]) for signal in rig.inputs)


def rig_state(
    equations: RigEquations, record: Record, values: Mapping[str, float], resting: int | None = None
) -> Floats:
    """Return the state of a rig without effects that agrees best with the first samples of its sensors."""
    # States that they do not determine are those of the static equilibrium under the first input. Else the state does not depend
    # on the numbers. Candidates that start from the same numbers of the rig start from the same state.
    shown = equations.shows_all_states(set(record.signals))
    numbers = b"" if shown else equations.parameters(values, record).tobytes()
    known = _known.setdefault(record, {})
    key = (equations, resting, numbers)
    if key not in known:
        moving = [n for n in equations.sensor_names if not shown or n in equations.of_coordinates]
        known[key] = _rig_state(equations, record, values, resting, moving, 0.0 if shown else _PULL)
    return known[key].copy()


def _rig_state(
    equations: RigEquations,
    record: Record,
    values: Mapping[str, float],
    resting: int | None,
    moving: Sequence[str],
    pull: float,
) -> Floats:
    """Return the state that agrees best with the readings of all sensors, and with the slopes of those that are `moving`."""
    # `pull` is the weight of the equilibrium, for states that the sensors do not show.
    p = equations.parameters(values, record)
    u = equations.inputs_of(record.slice(0, min(record.n_samples, _FIRST_SAMPLES)))[1][:, :1]
    begin = declared_start(equations.structure, p)
    if pull > 0.0:
        begin = _equilibrium(equations, begin, u, p)
    seen = [i for i, name in enumerate(equations.sensor_names) if name in record]
    if not seen or begin.size == 0:
        return begin
    names = [equations.sensor_names[i] for i in seen]
    sloping = np.array([name in moving for name in names])
    shown = np.array([_level_and_slope(record[name], record.dt, resting) for name in names])
    sizes = np.array([_sizes(record[name], record.dt) for name in names])
    scale = _state_scale(equations, begin, u, p, seen, sizes)
    n, still = equations.n_coordinates, resting is not None

    def full(moved: Floats) -> Floats:
        state: Floats = begin[:, None] + scale[:, None] * moved
        if still:
            state[n : 2 * n] = 0.0
        return state

    def remainder(moved: Floats) -> Floats:
        z = full(moved)
        inputs = np.repeat(u, z.shape[1], axis=1)
        level = (equations.readings(z, inputs, p)[seen] - shown[:, :1]) / sizes[:, :1]
        if still:
            return np.concatenate([level, pull * moved])
        slope = (equations.reading_slopes(z, inputs, p)[seen] - shown[:, 1:]) / sizes[:, 1:]
        return _finite(np.concatenate([level, slope[sloping], pull * moved]))

    return full(_least_squares(remainder, np.zeros(begin.size)).x[:, None])[:, 0]


def _of_one_motion(structure: Structure, record: Record, values: Mapping[str, float]) -> Floats:
    state = np.zeros(len(structure.states))
    offsets = _guessed_offsets(structure, record, values)
    state[state.size - len(offsets) :] = list(offsets.values())
    if not structure.rig.is_driven:
        return state
    record = _without(record, offsets)
    count = min(_FIRST_SAMPLES, record.n_samples)
    time = np.arange(count) * record.dt
    displacement = record[structure.rig.outputs[0].name][:count]
    # A free motion begins with its largest force, so its path is curved.
    degree = 2 if moves_freely(structure.rig, record) and count > 2 else 1
    state[1], state[0] = np.polyfit(time, displacement, degree)[-2:]
    for i, (name, dimension) in enumerate(
        zip(structure.state_names, structure.state_dimensions, strict=True)
    ):
        if name in record and i > 1:
            state[i] = float(np.mean(record[name][:count]))
        elif dimension == "input":
            state[i] = record[structure.rig.inputs[0].name][0]
    return state


def _guessed_offsets(structure: Structure, record: Record, values: Mapping[str, float]) -> dict[str, float]:
    """Return, for each sensor with a free offset, its mean reading minus that of the equilibrium under the mean input."""
    # The zero of a sensor may be far off, too far for a descent from an offset of zero.
    if not structure.offsets:
        return {}
    rig = structure.rig
    motion, mean = rig.motion, {name: float(np.mean(signal)) for name, signal in record.signals.items()}
    stiffness, rest, bias = (evaluated(e, values) for e in (motion.stiffness, motion.rest, motion.bias))
    response, source = rig.outputs[0].name, rig.inputs[0].name
    if not rig.is_driven:
        levels = {response: stiffness * (mean[source] - rest) + bias}
    elif stiffness > 0.0:
        levels = {response: rest + (evaluated(motion.drive_gain, values) * mean[source] + bias) / stiffness}
    else:
        # Without a spring it cannot be distinguished from the position.
        return dict.fromkeys(structure.offsets, 0.0)
    if rig.follower is not None:
        follower = rig.follower
        own = {**values, follower.symbol.name: 0.0}
        away = evaluated(follower.static_gain, values) * levels[response]
        levels[follower.symbol.name] = away - evaluated(follower.displacement, own)
    return {name: mean[name] - levels[name] if name in mean else 0.0 for name in structure.offsets}


def _without(record: Record, offsets: Mapping[str, float]) -> Record:
    """Return a record without these offsets of its sensors."""
    own = {name: record[name] - offset for name, offset in offsets.items() if name in record and offset}
    return record.with_signals(**own) if own else record


def _equilibrium(equations: RigEquations, declared: Floats, u: Floats, p: Floats) -> Floats:
    """Return the equilibrium under an input closest to the declared start; what is declared or without a force stays there."""
    n, state = equations.n_coordinates, declared.copy()
    held = np.ones(state.size, dtype=bool)
    held[n : 2 * n] = False
    held[[equations.state_names.index(symbol.name) for symbol in equations.rig.mechanism.initial]] = False
    resting = state.copy()
    resting[n : 2 * n] = 0.0
    # Two of three rows are derivatives of inputs.
    steady = np.where((np.arange(u.shape[0]) % 3 > 0)[:, None], 0.0, u)

    def unbalanced(places: Floats) -> Floats:
        z = np.repeat(resting[:, None], places.shape[1], axis=1)
        z[held] = places
        return _finite(equations.rates(z, np.repeat(steady, places.shape[1], axis=1), p)[n:])

    if np.any(held):
        found = _least_squares(unbalanced, state[held], x_scale="jac")
        if found.success:
            state[held] = found.x
    return state


def _least_squares(of: Callable[[Floats], Floats], start: Floats, **options: Any) -> OptimizeResult:
    """Return the least squares of a function of columns, whose differences are taken of all columns at once."""

    def at(place: Floats) -> Floats:
        return of(place[:, None])[:, 0]

    def slopes(place: Floats) -> Floats:
        steps = _DIFFERENCE * np.where(place < 0.0, -1.0, 1.0) * np.maximum(1.0, np.abs(place))
        moved = of(place[:, None] + np.column_stack([np.zeros(place.size), np.diag(steps)]))
        return np.asarray((moved[:, 1:] - moved[:, :1]) / steps)

    return least_squares(at, start, slopes, max_nfev=_MOST_EVALUATIONS, **options)


def _finite(values: Floats) -> Floats:
    """Return values with NaN and infinity replaced by large values."""
    return np.nan_to_num(values, nan=_HUGE, posinf=_HUGE, neginf=-_HUGE)


def _level_and_slope(signal: Floats, dt: float, resting: int | None) -> tuple[float, float]:
    if resting is not None:
        return float(np.mean(signal[:resting])), 0.0
    count = min(_FIRST_SAMPLES, signal.size)
    if count < 2:
        return float(signal[0]), 0.0
    time = np.arange(count) * dt
    slope, level = np.polyfit(time, signal[:count], 1)
    if count > _BENT:
        # A straight line through a bent path errs more than noise does: half the acceleration times its length.
        bent, covariance = np.polyfit(time, signal[:count], 2, cov=True)
        if abs(bent[0]) > _SURELY * np.sqrt(covariance[0, 0]):
            _, slope, level = bent
    return float(level), float(slope)


def _sizes(signal: Floats, dt: float) -> tuple[float, float]:
    """Return the size of a reading and of its slope; never zero."""
    size = size_of_signal([signal]) or 1.0
    slope = size_of_signal([np.gradient(signal, dt)]) if signal.size > 1 else 0.0
    return size, slope or size / (signal.size * dt)


def _state_scale(
    equations: RigEquations, state: Floats, u: Floats, p: Floats, seen: Sequence[int], sizes: Floats
) -> Floats:
    """Return the size of each state from the sensor that shows it best, one if none does, shape (n_states,)."""
    by_state = np.abs(equations.readings_by_state(state[:, None], u, p)[seen, :, 0])
    n, scale = equations.n_coordinates, np.full(state.size, np.inf)
    for row, (size, slope) in zip(by_state, sizes, strict=True):
        with np.errstate(divide="ignore"):
            scale = np.minimum(scale, np.where(row > 0.0, size / row, np.inf))
            scale[n : 2 * n] = np.minimum(scale[n : 2 * n], np.where(row[:n] > 0.0, slope / row[:n], np.inf))
    return np.where(np.isfinite(scale), scale, 1.0)


def _with_effects(
    structure: Structure, record: Record, equations: RigEquations, values: Mapping[str, float], own: Floats
) -> Floats:
    """Return the states of a structure: those of its rig, settled lags of its effects, and empty memory."""
    state = np.zeros(len(structure.states))
    state[: own.size] = own
    lagging = [
        (i, effect)
        for effect in structure.effects
        for i, name in enumerate(structure.state_names)
        if name.startswith(f"{effect.name}.") and effect.place in _OF_SIGNALS
    ]
    if not lagging:
        return state
    p = equations.parameters(values, record)
    u = equations.inputs_of(record.slice(0, min(record.n_samples, _FIRST_SAMPLES)))[1][:, :1]
    signals = equations.at_places(own[:, None], u, p)
    readings = dict(zip(equations.sensor_names, equations.readings(own[:, None], u, p)[:, 0], strict=True))
    for i, effect in lagging:
        place = structure.rig.acts_at(effect)
        bases = {base.partition("@")[0] for base in parse_dimension(structure.state_dimensions[i])}
        if effect.place is Place.ACTUATOR and bases == {"input"}:
            state[i] = float(signals[f"signal@{place}"][0])
        elif effect.place is Place.SENSOR and bases == {"x"}:
            state[i] = float(readings[place])
        elif effect.place is Place.CONTROLLER:
            followed = next(
                one for one in effect.states if structure.state_names[i] == f"{effect.name}.{one.symbol.name}"
            )
            state[i] = _followed(followed, {part: float(signals[f"{part}@{place}"][0]) for part in _CONTROL})
    return state


def _followed(state: State, signals: Mapping[str, float]) -> float:
    """Return where the state of a controller's effect stays: at what it filters; zero for an integral."""
    read = [name for name in signals if sp.Symbol(name, real=True) in state.rate.free_symbols]
    return signals[read[0]] if state.symbol in state.rate.free_symbols and len(read) == 1 else 0.0


def _resting_samples(record: Record, inputs: Sequence[str]) -> int:
    """Return the number of samples before an input changes."""
    first = record.n_samples
    for name in inputs:
        drive = record[name]
        moving = np.flatnonzero(np.abs(drive - drive[0]) > _RESTING * float(np.ptp(drive)))
        first = min(first, int(moving[0])) if moving.size else first
    return max(_FIRST_SAMPLES, first)
