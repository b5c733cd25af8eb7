"""Columns of effects along measured motions: what each adds to the equations of motion for a unit of its linear numbers.

Parameters in which an effect is linear become coefficients; the others, such as a clearance or the length of a presliding spring,
are tried on a grid, then beside its best point. A delay moves the reading, or the force that the motion requires of the drive. So
does a lag: what it weakens cannot be told from what smoothing takes from the measured motion. One longer than a radian of the
motion is no term.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect, Family, Place
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.errors import RigsightError
from rigsight.inverse.controller_terms import ControlledMotion, controlled_motion, of_controller
from rigsight.inverse.drive_terms import late_drive, lost, of_given, of_required
from rigsight.inverse.equation_fit import EquationFit, generalized, record_motions
from rigsight.inverse.joint_force import JointMotion, joint_motion
from rigsight.inverse.measured_motion import speed_at_rest
from rigsight.inverse.parameter_grid import LEAST_SHARE, POINTS, beside, grid_of, usual
from rigsight.inverse.sensor_terms import influence, late_reading, of_sensor
from rigsight.inverse.term import Term, compiled
from rigsight.records import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import evaluated
from rigsight.rigs.rig import joint_of

Floats = NDArray[np.float64]

_LATEST = 1.0
"""Longest delay or lag, in units of the time in which the motion advances by a radian (an assumption): a longer one makes driving
forces of restoring ones, and imitates any law."""


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
        self._controllers: dict[str, list[ControlledMotion]] = {}
        self._of_lateness: dict[tuple[str, float], tuple[Floats, ...] | None] = {}

    def along_records(self, records: Sequence[Record]) -> EffectTerms:
        """Return the terms along the motions of other records, with the same numbers and grids.

        Raises
        ------
        SimulationError
            If the sensors of a record do not show the motion.
        """
        fit = self.fit
        motions = record_motions(fit.rig, records, self.values)
        other = EquationFit(fit.rig, motions, fit.modelled, fit.free, self.values)
        return EffectTerms(other, self.values, self.scales)

    def can_show(self, effect: Effect) -> bool:
        """Return whether the motion can show an effect, as a term or in a fit.

        A free motion that is read later is another one of the same equations. A force over a position needs one that a sensor or
        the equations know: with a free first one it is any constant force in each record (one with a state is over the distance
        from it). A force that is even in the velocity needs both directions: in one it is that of an odd law.
        """
        if effect.family is Family.DELAY_OR_LAG and self._is_free:
            return effect.place is Place.SENSOR and self._is_redundant
        if effect.place is not Place.DYNAMICS:
            return True
        if effect.reads(canonical.x) and not effect.states:
            return any(motion.drifts or not motion.is_integrated for motion in self.fit.motions)
        return not _is_even(effect) or _moves_both_ways(self._motion_of(effect))

    def of(self, effect: Effect) -> Iterator[Term]:
        """Yield an effect at each point of the grid of its nonlinear parameters; nothing where it is no term.

        What one of more sensors than the motion needs does wrong shows beside the others, not in the equations.
        """
        if not self.can_show(effect) or (effect.place is Place.SENSOR and self._is_redundant):
            return
        if is_late(effect):
            yield from self._of_late(effect, self._lengths(effect))
        else:
            yield from self._at(effect, None)

    def at(self, effect: Effect, own: Mapping[str, float]) -> Iterator[Term]:
        """Yield an effect at its own parameters; what is linear in some of them keeps these open."""
        if is_late(effect):
            yield from self._of_late(effect, [lateness(effect, own)])
            return
        linear = {p.name for p in effect.linear_parameters}
        ratio = effect.post_yield_stiffness_ratio
        inner = {name: 0.0 if name == ratio else value for name, value in own.items() if name not in linear}
        yield from self._at(effect, [inner])

    def beside(self, term: Term, halvings: int) -> Iterator[Term]:
        """Yield the effect of a term on both sides of its nonlinear parameters, at a step of the grid halved so often."""
        if not is_late(term.effect):
            yield from self._at(term.effect, list(beside(term.effect, term.inner, self.scales, halvings)))
            return
        (length,), lengths = term.units, self._lengths(term.effect)
        ratio = (lengths[-1] / lengths[-2]) ** (0.5**halvings)
        near = (length / ratio, length * ratio)
        yield from self._of_late(term.effect, [own for own in near if abs(own) <= lengths[-1]])

    def _at(self, effect: Effect, points: Sequence[Mapping[str, float]] | None) -> Iterator[Term]:
        """Yield an effect of a sensor, a drive or a joint at points of its nonlinear parameters, or on their grid."""
        if effect.place is Place.SENSOR:
            yield from of_sensor(effect, self.fit, self.values, self.scales, self._by_motion, points)
        elif effect.place is Place.ACTUATOR:
            if points is None:
                yield from of_required(effect, self.fit, self.values, self.scales)
            yield from of_given(effect, self.fit, self.values, self.scales, points)
        elif effect.place is Place.CONTROLLER:
            if self.fit.motions[0].equations.n_coordinates:
                controlled = self._controlled(effect)
                yield from of_controller(effect, controlled, self.scales, points, bool(self.fit.gains))
        elif is_joint_force(effect) and not _is_resonance(effect):
            moved = self._motion_of(effect)
            yield from _of_joint(effect, self.fit, self.values, self.scales, moved, points)

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
            shown = compiled(effect.measured, (canonical.reading, *numbers))
            rows = [
                influence(m, by, values, name, m.record[name] - shown(m.record[name], *own.values()))
                for m, by in zip(motions, self._by_motion, strict=True)
            ]
        elif effect.place is Place.ACTUATOR:
            drive = next(drive for drive in fit.rig.mechanism.drives if drive.name == fit.rig.acts_at(effect))
            rows = [lost(drive, effect, own, fit, m, values) for m in motions]
        elif effect.place is Place.CONTROLLER:
            rows = [moved.lost(effect, own) for moved in self._controlled(effect)]
        else:
            along = zip(motions, self._motion_of(effect), strict=True)
            rows = [generalized(m, effect, own, values, moved) for m, moved in along]
        return self._thinned(rows)

    def _lengths(self, effect: Effect) -> list[float]:
        """Return the lengths of a delay or a lag that are tried."""
        (parameter,) = (p for p in effect.parameters if p.fitted)
        longest = usual(effect, parameter, self.scales)
        if self.fit.motions[0].equations.n_coordinates == 1:
            # A joint that turns on and on has a long time of its own, but its speed may change fast.
            longest = min(longest, *(self.scales[f"time@{s.name}"] for s in self.fit.rig.outputs))
        lengths = longest * np.geomspace(LEAST_SHARE, _LATEST, POINTS[1])
        if parameter.lower < 0.0:
            lengths = np.concatenate([-lengths, lengths])
        return [float(length) for length in lengths]

    def _of_late(self, effect: Effect, lengths: Sequence[float]) -> Iterator[Term]:
        """Yield a delay or a lag of each length."""
        (parameter,) = (p for p in effect.parameters if p.fitted)
        for length in lengths:
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
            of_place = late_reading if effect.place is Place.SENSOR else late_drive
            rows = [of_place(key[0], late, motion, by, self.values) for motion, by in along]
            # At its ends a motion that is ahead is not known, and its derivatives even less.
            self._of_lateness[key] = self._thinned(
                [
                    None if own is None else own * motion.known_ahead(late)
                    for own, motion in zip(rows, self.fit.motions, strict=True)
                ]
            )
        return self._of_lateness[key]

    def _thinned(self, rows: Sequence[Floats | None]) -> tuple[Floats, ...] | None:
        """Return rows along each motion filtered and thinned; None where one is missing or not finite."""
        found = [m.thinned(own) for m, own in zip(self.fit.motions, rows, strict=True) if own is not None]
        finite = len(found) == len(rows) and all(np.all(np.isfinite(own)) for own in found)
        return tuple(found) if finite else None

    @property
    def _is_redundant(self) -> bool:
        n = self.fit.motions[0].equations.n_coordinates
        return n > 0 and any(len(motion.sensors) > n for motion in self.fit.motions)

    @cached_property
    def _is_free(self) -> bool:
        """Whether one coordinate moves and nothing drives it."""
        inputs = [signal.name for signal in self.fit.rig.inputs]
        still = all(is_constant(m.record[name]) for m in self.fit.motions for name in inputs)
        return still and self.fit.motions[0].equations.n_coordinates == 1

    @cached_property
    def _by_motion(self) -> list[Floats]:
        if not self.fit.motions[0].equations.n_states:
            return [np.zeros(0) for _ in self.fit.motions]
        return [motion.by_motion(self.values) for motion in self.fit.motions]

    def _controlled(self, effect: Effect) -> list[ControlledMotion]:
        drive = self.fit.rig.acts_at(effect)
        if drive not in self._controllers:
            self._controllers[drive] = [controlled_motion(m, drive, self.values) for m in self.fit.motions]
        return self._controllers[drive]

    def _motion_of(self, effect: Effect) -> list[JointMotion]:
        joint = joint_of(self.fit.rig, effect)
        if joint.name not in self._moved:
            self._moved[joint.name] = [joint_motion(m, joint, self.values) for m in self.fit.motions]
        return self._moved[joint.name]


def _is_even(effect: Effect) -> bool:
    """Return whether a force depends on the size of the velocity alone."""
    law = effect.torque
    turned = None if law is None else law.xreplace({canonical.v: -canonical.v})
    return not effect.states and effect.reads(canonical.v) and turned == law


def _moves_both_ways(motions: Sequence[JointMotion]) -> bool:
    """Return whether a joint moves in both directions, in one record or in several."""
    ways = {sign for m in motions for sign in (-1.0, 1.0) if np.any(sign * m.v > speed_at_rest(m.v))}
    return len(ways) > 1


def _of_joint(
    effect: Effect,
    fit: EquationFit,
    values: Mapping[str, float],
    scales: Mapping[str, float],
    moved: Sequence[JointMotion],
    points: Sequence[Mapping[str, float]] | None,
) -> Iterator[Term]:
    joint = joint_of(fit.rig, effect)
    springs = effect.spring is not None or effect.deflection is not None
    if springs and not evaluated(joint.stiffness, {**values, **fit.motions[0].record.constants}) > 0.0:
        return
    linear = effect.linear_parameters
    units = [usual(effect, p, scales) for p in linear]
    if effect.holds_constant_force and linear and all(p.lower >= 0.0 for p in linear):
        one_sided = (False,) * len(linear)
    else:
        one_sided = tuple(p.lower >= 0.0 for p in linear) or (True,)
    nothing = dict.fromkeys((p.name for p in linear), 0.0)
    tried, rows = list(grid_of(effect, linear, scales) if points is None else points), []
    along = list(zip(fit.motions, moved, strict=True))
    for inner in tried:
        own = [{**inner, **nothing, p.name: unit} for p, unit in zip(linear, units, strict=True)] or [
            dict(inner)
        ]
        try:
            rows.append([[generalized(m, effect, o, values, joint) for o in own] for m, joint in along])
        except RigsightError:
            break
    if not rows:
        return
    # All points at once: a filter costs as much for one of them as for all.
    of_motions = zip(*rows, strict=True)
    filtered = [m.thinned(np.array(own)) for m, own in zip(fit.motions, of_motions, strict=True)]
    names, most = tuple(p.name for p in linear), tuple(max(map(abs, p.search)) for p in linear)
    for inner, *columns in zip(tried[: len(rows)], *filtered, strict=True):
        if all(np.all(np.isfinite(column)) for column in columns):
            yield Term(effect, inner, names, tuple(units), tuple(columns), one_sided, most)


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
