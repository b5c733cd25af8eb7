"""Columns of effects along measured motions: what each adds to the equations of motion for a unit of its linear numbers.

Parameters in which an effect is linear become coefficients; the others, such as a clearance or the length of a presliding spring,
are tried on a grid. Effects of a drive are functions of the force that the motion requires, not of the logged input: a clip of
the logged input would explain that input. Effects of a sensor are what a small change of its reading changes in the equations.
A tone has the frequency of a line that the residual has in all records, and its own phase in each of them.
A delay moves the reading, or the force that the motion requires of the drive, and so does a lag: what it weakens cannot be told
from what smoothing takes from the measured motion. One longer than a radian of the motion is no term.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect, Place, placed_dimension
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.errors import RigsightError
from rigsight.frequency.persistent_line import line_power, persistent_line
from rigsight.identify.rig_equations import FUNCTIONS
from rigsight.inverse.equation_fit import EquationFit, generalized, per_force
from rigsight.inverse.joint_force import JointMotion, joint_motion
from rigsight.inverse.measured_motion import RecordMotion
from rigsight.inverse.smooth_signals import shifted
from rigsight.parameters import Parameter
from rigsight.rigs import Drive, evaluated
from rigsight.rigs.rig import joint_of
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

_GRID = {0: 1, 1: 6, 2: 4}
"""Points of the grid of each nonlinear parameter, by their number; two points beyond."""
_WAVES = 40
"""Points of the grid of a wave number: between two of them a wave loses its phase at the ends of the motion."""
_LEAST_SHARE, _MOST_SHARE = 0.02, 3.0
"""Range of the grid in characteristic sizes, within that of a search."""
_LATEST = 1.0
"""Longest delay or lag, in units of the time in which the motion advances by a radian (an assumption): a longer one makes driving
forces of restoring ones, and imitates any law."""
_FINER = 8
"""Frequencies tried on either side of a line, up to the next one that the longest record resolves."""
_MOST_PHASES = 12
"""Records up to which each has a tone of its own phase: of more, each is left out as a whole, and its phase is not known."""
_OWN_LINE = 0.5
"""Share of an input's power in one line from which the motion has one frequency (an assumption)."""
_OVERTONES = (1, 2, 3, 4, 5)
"""Overtones of an input's line that laws of the motion make."""
_SMALL_PART = 0.05
"""Parameters of a drive effect in characteristic sizes: small, and above the noise of the force."""


@dataclass(frozen=True, eq=False)
class Term:
    """An effect at given nonlinear parameters, as columns of the equations."""

    effect: Effect  # with its place
    inner: Mapping[str, float]  # values of its nonlinear parameters
    names: tuple[str, ...]  # of its linear parameters, one for each part; empty where a part is no parameter
    units: tuple[float, ...]  # value of the linear parameter that a column stands for
    # Of each record, filtered and thinned, shape (n_parts, n_equations, n_rows) each.
    columns: tuple[Floats, ...]
    one_sided: tuple[bool, ...]  # whether a coefficient cannot be negative


def is_joint_force(effect: Effect) -> bool:
    """Return True for a force at a joint that follows from the motion of this joint."""
    return effect.place is Place.DYNAMICS and not effect.reads_inertia


def _is_resonance(effect: Effect) -> bool:
    """Return True for an effect with an oscillation of its own, which is narrower than any grid."""
    return sum(state.limit is None for state in effect.states) > 1


class EffectTerms:
    """Effects as terms of the equations along motions.

    Parameters
    ----------
    fit
        Equations and motions.
    values
        Constants and parameters of the equations.
    scales
        Size of each base quantity in the records.
    """

    def __init__(self, fit: EquationFit, values: Mapping[str, float], scales: Mapping[str, float]) -> None:
        self.fit, self.values, self.scales = fit, values, scales
        self._moved: dict[str, list[JointMotion]] = {}
        self._of_lateness: dict[tuple[str, float], tuple[Floats, ...] | None] = {}

    def of(self, effect: Effect) -> Iterator[Term]:
        """Yield an effect at each point of the grid of its nonlinear parameters; nothing where it is no term."""
        if is_late(effect):
            yield from self._of_late(effect)
        elif effect.place is Place.SENSOR:
            yield from _of_sensor(effect, self.fit, self.values, self.scales, self._by_motion)
        elif effect.place is Place.ACTUATOR:
            yield from _of_drive(effect, self.fit, self.values, self.scales)
        elif is_joint_force(effect) and not _is_resonance(effect):
            yield from _of_joint(effect, self.fit, self.values, self.scales, self._motion_of(effect))

    def of_tone(self, effect: Effect, residuals: Sequence[Floats]) -> Iterator[Term]:
        """Yield a tone at the line that the residuals along all motions share; nothing where they share none.

        Parameters
        ----------
        effect
            A tone.
        residuals
            Of each record, filtered and thinned, shape (n_equations, n_rows) each.
        """
        yield from _of_tone(effect, self.fit, self.values, residuals)

    def acting(self, effect: Effect, own: Mapping[str, float]) -> tuple[Floats, ...] | None:
        """Return what an effect that acts would add to what the equations need, along each motion, filtered and thinned.

        Parameters
        ----------
        effect
            One that has a term.
        own
            Its parameters by their own names.

        Returns
        -------
            Shape (n_equations, n_rows) each; None where it cannot be evaluated.
        """
        fit, values, motions = self.fit, self.values, self.fit.motions
        if is_late(effect):
            return self._late(effect, lateness(effect, own))
        if effect.place is Place.SENSOR:
            name, numbers = fit.rig.acts_at(effect), [sp.Symbol(p, real=True) for p in own]
            assert effect.measured is not None
            shown = _compiled(effect.measured, (canonical.reading, *numbers))
            rows = [
                _influence(m, by, values, name, m.record[name] - shown(m.record[name], *own.values()))
                for m, by in zip(motions, self._by_motion, strict=True)
            ]
        elif effect.place is Place.ACTUATOR:
            drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
            rows = [_lost(drive, effect, own, fit, m, values) for m in motions]
        else:
            along = zip(motions, self._motion_of(effect), strict=True)
            rows = [generalized(m, effect, own, values, moved) for m, moved in along]
        return self._thinned(rows)

    def _of_late(self, effect: Effect) -> Iterator[Term]:
        """Yield a delay or a lag at each length of a grid."""
        (parameter,) = (p for p in effect.parameters if p.fitted)
        usual = _usual(effect, parameter, self.scales)
        if self.fit.motions[0].equations.n_coordinates == 1:
            # A joint that turns on and on has a long time of its own, but its speed may change fast.
            usual = min(usual, *(self.scales[f"time@{s.name}"] for s in self.fit.rig.outputs))
        lengths = usual * np.geomspace(_LEAST_SHARE, _LATEST, _GRID[1])
        if parameter.lower < 0.0:
            lengths = np.concatenate([-lengths, lengths])
        for length in map(float, lengths):
            rows = self.acting(effect, {parameter.name: length})
            if rows is None:
                return
            columns = tuple(own[None] for own in rows)
            yield Term(effect, {}, (parameter.name,), (length,), columns, (True,))

    def _late(self, effect: Effect, late: float) -> tuple[Floats, ...] | None:
        """Return what a delay or a lag takes from the equations; of one length at one place they take the same."""
        key = (self.fit.rig.acts_at(effect), late)
        if key not in self._of_lateness:
            along = zip(self.fit.motions, self._by_motion, strict=True)
            of_place = _late_reading if effect.place is Place.SENSOR else _late_drive
            self._of_lateness[key] = self._thinned(
                [of_place(key[0], late, motion, by, self.values) for motion, by in along]
            )
        return self._of_lateness[key]

    def _thinned(self, rows: Sequence[Floats | None]) -> tuple[Floats, ...] | None:
        """Return rows along each motion filtered and thinned; None where one is missing or not finite."""
        found = [m.thinned(own) for m, own in zip(self.fit.motions, rows, strict=True) if own is not None]
        finite = len(found) == len(rows) and all(np.all(np.isfinite(own)) for own in found)
        return tuple(found) if finite else None

    @cached_property
    def _by_motion(self) -> list[Floats]:
        if not self.fit.motions[0].equations.n_states:
            return [np.zeros(0) for _ in self.fit.motions]
        return [motion.by_motion(self.values) for motion in self.fit.motions]

    def _motion_of(self, effect: Effect) -> list[JointMotion]:
        joint = joint_of(self.fit.rig, effect)
        if joint.name not in self._moved:
            self._moved[joint.name] = [joint_motion(m, joint, self.values) for m in self.fit.motions]
        return self._moved[joint.name]


def _of_joint(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    moved: Sequence[JointMotion],
) -> Iterator[Term]:
    joint = joint_of(fit.rig, effect)
    springs = effect.spring is not None or effect.deflection is not None
    if springs and not evaluated(joint.stiffness, {**values, **fit.motions[0].record.constants}) > 0.0:
        return
    linear = [p for p in effect.parameters if p.fitted and _is_linear(effect, p)]
    units = [_usual(effect, p, scales) for p in linear]
    if effect.holds_constant_force and linear and all(p.lower >= 0.0 for p in linear):
        one_sided = (False,) * len(linear)
    else:
        one_sided = tuple(p.lower >= 0.0 for p in linear) or (True,)
    for inner in _grid_of(effect, linear, scales):
        nothing = dict.fromkeys((p.name for p in linear), 0.0)
        own = [{**inner, **nothing, p.name: unit} for p, unit in zip(linear, units, strict=True)] or [inner]
        try:
            columns = tuple(
                motion.thinned(np.array([generalized(motion, effect, o, values, along) for o in own]))
                for motion, along in zip(fit.motions, moved, strict=True)
            )
        except RigsightError:
            return
        if all(np.all(np.isfinite(column)) for column in columns):
            yield Term(effect, inner, tuple(p.name for p in linear), tuple(units), columns, one_sided)


def _of_tone(
    effect: Effect, fit: EquationFit, values: Mapping[str, float], rows: Sequence[Floats]
) -> Iterator[Term]:
    # Each record has a phase of its own. Where the motion has one frequency and this is an overtone, what follows from the motion
    # and a tone are one.
    motions, joint = fit.motions, joint_of(fit.rig, effect)
    pushes = [per_force(motion, joint, values) for motion in motions]
    row = int(np.argmax(sum(np.sum(push**2, axis=1) for push in pushes)))
    residuals = [own[row] for own in rows]
    steps = [motion.record.dt * motion.stride for motion in motions]
    line = persistent_line(residuals, steps)
    inputs = [signal - np.mean(signal) for motion in motions for signal in motion.u[::3]]
    if line is None or len(motions) > _MOST_PHASES:
        return
    spacing = np.pi / max(r.size * dt for r, dt in zip(residuals, steps, strict=True))
    near = line + spacing * np.arange(-_FINER, _FINER + 1) / _FINER
    power = [sum(line_power(r, dt, w) for r, dt in zip(residuals, steps, strict=True)) for w in near]
    pulsation = float(near[int(np.argmax(power))])
    of_inputs = zip(inputs, np.repeat([m.record.dt for m in motions], len(motions[0].u) // 3), strict=True)
    if any(
        line_power(signal, dt, pulsation / overtone) > _OWN_LINE * float(signal @ signal)
        for signal, dt in of_inputs
        for overtone in _OVERTONES
    ):
        return
    columns = []
    for i, (motion, push) in enumerate(zip(motions, pushes, strict=True)):
        phase = pulsation * motion.record.dt * np.arange(motion.record.n_samples)
        own = np.zeros((2 * len(motions), *push.shape))
        own[2 * i], own[2 * i + 1] = push * np.sin(phase), push * np.cos(phase)
        columns.append(motion.thinned(own))
    parts = 2 * len(motions)
    yield Term(
        effect, {effect.pulsation or "": pulsation}, (), (1.0,) * parts, tuple(columns), (False,) * parts
    )


def _is_linear(effect: Effect, parameter: Parameter) -> bool:
    if effect.torque is None:
        return False
    symbol = sp.Symbol(parameter.name, real=True)
    in_states = any(state.rate.has(symbol) for state in effect.states)
    return not in_states and not derivative(effect.torque, symbol).has(symbol)


def _grid_of(
    effect: Effect, linear: Sequence[Parameter], scales: Mapping[str, float]
) -> Iterator[dict[str, float]]:
    inside = [p for p in effect.parameters if p.fitted and p not in linear]
    held = {p.name: p.held_at(_usual(effect, p, scales)) for p in effect.parameters if not p.fitted}
    n = _GRID.get(len(inside), 2)
    grids = [
        _waves(effect, p, scales) if p.name == effect.wave_number else _grid(effect, p, scales, n)
        for p in inside
    ]
    for values in itertools.product(*grids):
        yield {**held, **dict(zip((p.name for p in inside), map(float, values), strict=True))}


def _grid(effect: Effect, parameter: Parameter, scales: Mapping[str, float], n: int) -> Floats:
    low, high = max(parameter.search[0], _LEAST_SHARE), min(parameter.search[1], _MOST_SHARE)
    return _usual(effect, parameter, scales) * np.geomspace(low, 0.97 * high, n)


def _waves(effect: Effect, parameter: Parameter, scales: Mapping[str, float]) -> Floats:
    return _usual(effect, parameter, scales) * np.linspace(*parameter.search, _WAVES)


def _usual(effect: Effect, parameter: Parameter, scales: Mapping[str, float]) -> float:
    """Return the size of a parameter in the records, at the place of its effect."""
    return characteristic_value(placed_dimension(effect, parameter.dimension), scales)


def is_late(effect: Effect) -> bool:
    """Return True for a delay, and for a lag of first order."""
    if effect.delay is not None or effect.reading_delay is not None:
        return True
    return len(effect.states) == 1 and effect.states[0].symbol in (effect.drive, effect.measured)


def lateness(effect: Effect, own: Mapping[str, float]) -> float:
    """Return the time by which a delay or a lag with own parameters makes slow signals late."""
    late = effect.delay if effect.delay is not None else effect.reading_delay
    if late is None:
        (state,) = effect.states
        late = -1 / derivative(state.rate, state.symbol)
    return float(late.subs({sp.Symbol(name, real=True): value for name, value in own.items()}))


def _late_reading(
    name: str, late: float, motion: RecordMotion, by_motion: Floats, values: Mapping[str, float]
) -> Floats | None:
    """Return what a late reading takes from the equations, shape (n_equations, n_samples); None where it takes nothing."""
    if name not in motion.record:
        return None
    reading = motion.filtered(motion.record[name])
    return _influence(motion, by_motion, values, name, shifted(reading, motion.record.dt, late) - reading)


def _late_drive(
    name: str, late: float, motion: RecordMotion, by_motion: Floats, values: Mapping[str, float]
) -> Floats | None:
    """Return what a late drive takes from the equations, as `_late_reading`: what is required of it now was commanded earlier."""
    if not motion.equations.n_coordinates:
        return None
    along, more = _through_drive(name, motion, values, _along_change(by_motion, motion.ahead(late)))
    return np.asarray(along * more)


def _of_drive(
    effect: Effect, fit: EquationFit, values: Mapping[str, float], scales: Mapping[str, float]
) -> Iterator[Term]:
    """Yield what the input must give beyond what reaches the motion, a function of what the motion requires.

    To first order in small parameters. With large ones nearly all of the required force is lost, and this force holds the
    residual that it would explain.
    """
    drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
    per_input = [_force_per_input(drive, {**values, **motion.record.constants}) for motion in fit.motions]
    own = [sp.Symbol(p.name, real=True) for p in effect.parameters]
    is_function = effect.drive is not None and effect.drive.free_symbols <= {canonical.u, *own}
    vanishes = all(p.null == 0.0 for p in effect.parameters)
    if not (is_function and vanishes and fit.motions[0].equations.n_coordinates and all(per_input)):
        return
    inner = {p.name: _SMALL_PART * _usual(effect, p, scales) for p in effect.parameters}
    columns = [
        motion.thinned(_lost(drive, effect, inner, fit, motion, values))[None] for motion in fit.motions
    ]
    if all(np.all(np.isfinite(column)) for column in columns):
        yield Term(effect, inner, (), (), tuple(columns), (True,))


def _lost(
    drive: Drive,
    effect: Effect,
    own: Mapping[str, float],
    fit: EquationFit,
    motion: RecordMotion,
    values: Mapping[str, float],
) -> Floats:
    """Return the force that a drive effect takes from what the motion requires, shape (n_equations, n_samples)."""
    assert effect.drive is not None
    gain = _force_per_input(drive, {**values, **motion.record.constants})
    along, force = _required(drive, fit, motion, values)
    reaching = _compiled(effect.drive, (canonical.u, *(sp.Symbol(name, real=True) for name in own)))
    return np.asarray(along * (force - gain * reaching(force / gain, *own.values())))


def _force_per_input(drive: Drive, numbers: Mapping[str, float]) -> float:
    gain = derivative(drive.force, sp.Symbol(drive.name, real=True))
    known = {symbol.name for symbol in gain.free_symbols} <= numbers.keys()
    return float(evaluated(gain, numbers)) if known else 0.0


def _required(
    drive: Drive, fit: EquationFit, motion: RecordMotion, values: Mapping[str, float]
) -> tuple[Floats, Floats]:
    """Return how a drive enters the equations, shape (n_equations, n_samples), and the force that the motion requires of it."""
    equations = motion.equations
    along, missing = _through_drive(drive.name, motion, values, fit.residual(motion, values))
    p = equations.parameters(values, motion.record)
    given = equations.at_places(motion.z, motion.u, p)[f"force@{drive.name}"]
    return along, motion.filtered(missing + given)


def _through_drive(
    name: str, motion: RecordMotion, values: Mapping[str, float], rows: Floats
) -> tuple[Floats, Floats]:
    """Return how a drive enters the equations, shape (n_equations, n_samples), and the force of the drive nearest to rows."""
    p = motion.equations.parameters(values, motion.record)
    along = motion.equations.slopes_along(motion.z, motion.u, p)[name]
    size = np.maximum(np.sum(along**2, axis=0), np.finfo(np.float64).tiny)
    return along, np.sum(along * rows, axis=0) / size


def _of_sensor(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    by_motion: Sequence[Floats],
) -> Iterator[Term]:
    """Yield what small changes of the reading, which undo a unit of each linear parameter, change in the equations."""
    name = fit.rig.acts_at(effect)
    if effect.measured is None or effect.states or any(name not in motion.record for motion in fit.motions):
        return
    fitted = [p for p in effect.parameters if p.fitted]
    slopes = {p: derivative(effect.measured, sp.Symbol(p.name, real=True)) for p in fitted}
    linear = [p for p in fitted if not slopes[p].has(sp.Symbol(p.name, real=True))]
    if any(slopes[p].has(sp.Symbol(other.name, real=True)) for p in linear for other in linear):
        return
    for inner in _grid_of(effect, linear, scales):
        arguments = (canonical.reading, *(sp.Symbol(own, real=True) for own in inner))
        columns = []
        for motion, by in zip(fit.motions, by_motion, strict=True):
            changes = [-_compiled(slopes[p], arguments)(motion.record[name], *inner.values()) for p in linear]
            parts = [_influence(motion, by, values, name, change) for change in changes]
            if any(part is None for part in parts):
                return
            columns.append(motion.thinned(np.array(parts)))
        names, sided = tuple(p.name for p in linear), tuple(p.lower >= 0.0 for p in linear)
        yield Term(effect, inner, names, (1.0,) * len(linear), tuple(columns), sided)


@lru_cache(maxsize=256)
def _compiled(expression: sp.Expr, arguments: tuple[sp.Symbol, ...]) -> Callable[..., Floats]:
    function = sp.lambdify(arguments, expression, [FUNCTIONS, "numpy"])
    return lambda signal, *numbers: np.broadcast_to(function(signal, *numbers), signal.shape).astype(
        np.float64
    )


def _influence(
    motion: RecordMotion, by_motion: Floats, values: Mapping[str, float], name: str, change: Floats
) -> Floats | None:
    """Return the change of the residual of the rig's equations by a small change of a reading; None where it has none."""
    if not np.any(change):
        return None
    if not motion.equations.n_states:
        rows = np.zeros((len(motion.sensors), change.size))
        rows[[motion.equations.sensor_names[i] for i in motion.sensors].index(name)] = -change
        return rows
    moved = motion.with_reading_changed(name, change, values)
    return None if moved is None else _along_change(by_motion, moved)


def _along_change(by_motion: Floats, change: tuple[Floats, Floats]) -> Floats:
    """Return the change of the equations by small changes of `z` and `a`, shape (n_equations, n_samples)."""
    return np.asarray(np.einsum("ekt,kt->et", by_motion, np.concatenate(change)))
