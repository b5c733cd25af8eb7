"""Columns of effects along measured motions: what each adds to the equations of motion for a unit of its linear numbers.

Parameters in which an effect is linear become coefficients; the others, such as a clearance or the length of a presliding spring,
are tried on a grid. Effects of a drive are functions of the force that the motion requires, not of the logged input: a clip of
the logged input would explain that input. Effects of a sensor are what a small change of its reading changes in the equations.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect, Place, kind_of
from rigsight.effects.symbols import derivative
from rigsight.errors import RigsightError
from rigsight.inverse.equation_fit import EquationFit, generalized
from rigsight.inverse.joint_force import JointMotion, joint_motion
from rigsight.inverse.measured_motion import RecordMotion
from rigsight.parameters import Parameter
from rigsight.rigs import evaluated
from rigsight.rigs.rig import joint_of
from rigsight.units import characteristic_value

Floats = NDArray[np.float64]

_GRID = {0: 1, 1: 6, 2: 4}
"""Points of the grid of each nonlinear parameter, by their number; two points beyond."""
_WAVES = 40
"""Points of the grid of a wave number: between two of them a wave loses its phase at the ends of the motion."""
_LEAST_SHARE, _MOST_SHARE = 0.02, 3.0
"""Range of the grid in characteristic sizes, within that of a search."""
_SMALL = 1e-3
"""Change of a reading, in units of its deviation, from which its influence on the equations is taken."""
_ROUNDED = 0.05
"""Width of the step of a dead zone, in units of the required force: near zero the noise of the force decides its sign."""


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

    def of(self, effect: Effect) -> Iterator[Term]:
        """Yield an effect at each point of the grid of its nonlinear parameters; nothing where it is no term."""
        if effect.place is Place.SENSOR or kind_of(effect.name) == "time_shift":
            yield from _of_sensor(effect, self.fit, self.values, self.scales)
        elif effect.place is Place.ACTUATOR:
            yield from _of_drive(effect, self.fit, self.values)
        elif effect.place in (Place.DYNAMICS, Place.DISTURBANCE) and not effect.reads_inertia:
            joint = joint_of(self.fit.rig, effect)
            if joint.name not in self._moved:
                self._moved[joint.name] = [joint_motion(m, joint, self.values) for m in self.fit.motions]
            yield from _of_joint(effect, self.fit, self.values, self.scales, self._moved[joint.name])


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
    units = [characteristic_value(p.dimension, scales) for p in linear]
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
    held = {
        p.name: p.held_at(characteristic_value(p.dimension, scales))
        for p in effect.parameters
        if not p.fitted
    }
    n = _GRID.get(len(inside), 2)
    grids = [_waves(p, scales) if p.name == effect.wave_number else _grid(p, scales, n) for p in inside]
    for values in itertools.product(*grids):
        yield {**held, **dict(zip((p.name for p in inside), map(float, values), strict=True))}


def _grid(parameter: Parameter, scales: Mapping[str, float], n: int) -> Floats:
    size = characteristic_value(parameter.dimension, scales)
    low, high = max(parameter.search[0], _LEAST_SHARE), min(parameter.search[1], _MOST_SHARE)
    return size * np.geomspace(low, 0.97 * high, n)


def _waves(parameter: Parameter, scales: Mapping[str, float]) -> Floats:
    return characteristic_value(parameter.dimension, scales) * np.linspace(*parameter.search, _WAVES)


_OF_FORCE: Mapping[str, Callable[[Floats, float], Floats]] = {
    "input_dead_zone": lambda force, _: np.tanh(force / (_ROUNDED * _rms(force))),
    "input_saturation": lambda force, _: force**3 / _rms(force) ** 2,
    "input_delay": lambda force, dt: np.gradient(force, dt),
    "actuator_lag": lambda force, dt: np.gradient(force, dt),
}
"""What an effect of a drive adds to the force that the input must give, as a function of the force that the motion requires."""


def _of_drive(effect: Effect, fit: EquationFit, values: Mapping[str, float]) -> Iterator[Term]:
    shape = _OF_FORCE.get(kind_of(effect.name))
    if shape is None:
        return
    drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
    columns = []
    for motion in fit.motions:
        equations = motion.equations
        if not equations.n_coordinates:
            return
        p = equations.parameters(values, motion.record)
        along = equations.slopes_along(motion.z, motion.u, p)[drive.name]
        missing = np.sum(along * fit.residual(motion, values), axis=0) / np.maximum(
            np.sum(along**2, axis=0), 1e-300
        )
        required = motion.filtered(
            missing + equations.at_places(motion.z, motion.u, p)[f"force@{drive.name}"]
        )
        if not np.any(required):
            return
        columns.append(motion.thinned(along * shape(required, motion.record.dt))[None])
    if all(np.all(np.isfinite(column)) for column in columns):
        yield Term(effect, {}, (), (), tuple(columns), (True,))


def _of_sensor(
    effect: Effect, fit: EquationFit, values: Mapping[str, float], scales: Mapping[str, float]
) -> Iterator[Term]:
    name = fit.rig.acts_at(effect)
    for inner, shapes in _of_reading(effect, scales):
        columns = []
        for motion in fit.motions:
            if name not in motion.record:
                nothing = np.zeros((len(shapes), *fit.residual(motion, values).shape))
                columns.append(motion.thinned(nothing))
                continue
            reading = motion.record[name]
            parts = [
                _influence(fit, motion, values, name, shape(reading, motion.record.dt)) for shape in shapes
            ]
            if any(part is None for part in parts):
                return
            columns.append(motion.thinned(np.array(parts)))
        sided = effect.wave_number is None and kind_of(effect.name) != "time_shift"
        yield Term(effect, inner, (), (), tuple(columns), (sided,) * len(shapes))


Shape = Callable[[Floats, float], Floats]


def _of_reading(
    effect: Effect, scales: Mapping[str, float]
) -> Iterator[tuple[dict[str, float], tuple[Shape, ...]]]:
    """Yield what must be added to a reading to undo an effect of the sensor, by nonlinear parameter."""
    if kind_of(effect.name) in ("sensor_delay", "sensor_lag", "time_shift"):
        yield {}, (lambda reading, dt: np.gradient(reading, dt),)
    elif effect.wave_number is not None:
        (wave,) = [p for p in effect.parameters if p.name == effect.wave_number]
        for number in _waves(wave, scales):
            yield (
                {wave.name: float(number)},
                (
                    lambda reading, _, k=number: _rms(reading) * np.sin(k * reading),  # type: ignore[misc]
                    lambda reading, _, k=number: _rms(reading) * np.cos(k * reading),  # type: ignore[misc]
                ),
            )


def _influence(
    fit: EquationFit, motion: RecordMotion, values: Mapping[str, float], name: str, change: Floats
) -> Floats | None:
    """Return the change of the residual of the equations by a small change of a reading; None where it has none."""
    size = _rms(change)
    if not size > 0.0:
        return None
    if not motion.equations.n_states:
        rows = np.zeros((len(motion.sensors), change.size))
        rows[[motion.equations.sensor_names[i] for i in motion.sensors].index(name)] = -change
        return rows
    moved = motion.with_reading_changed(name, change, values)
    if moved is None:
        return None
    step = _SMALL * _rms(motion.record[name] - np.mean(motion.record[name])) / size
    near = motion.moved_by(moved, step)
    return np.asarray((fit.residual(near, values) - fit.residual(motion, values)) / step)


def _rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2)))
