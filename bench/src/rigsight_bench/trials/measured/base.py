"""Numbers of the base equations of a measured campaign, by regression along the measured motion, and what they leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from rigsight.campaign import Campaign
from rigsight.effects import Effect, effect_named, placed
from rigsight.errors import SimulationError
from rigsight.identify import characteristic_scales
from rigsight.records import Record
from rigsight.rigs import Joint, Rig
from rigsight.rigs.rig import joint_of
from rigsight.simulate import compose
from rigsight_bench.trials.measured.forces import JointMotion, effect_force, joint_motion
from rigsight_bench.trials.measured.motion import RecordMotion, record_motion

Floats = NDArray[np.float64]

FRICTION = "coulomb_friction"
_HELPS = 0.95
"""Share of the error of the equations without friction below which friction at a joint belongs to the base."""
_ROUNDS = 12
_SETTLED = 1e-6
_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Base:
    """The base equations of a campaign with their numbers.

    Attributes
    ----------
    campaign
        The campaign.
    modelled
        Effects of the base equations: those of the campaign, or friction at a joint, or none.
    is_chosen
        True if the records chose them.
    values
        Constants, parameters and numbers of these effects by name.
    free
        Names of the numbers that the regression moves.
    left
        RMS of what they leave of each equation, in the band of the motion.
    without
        The same equations without the friction that was chosen, if one was.
    """

    campaign: Campaign
    modelled: tuple[Effect, ...]
    is_chosen: bool
    values: Mapping[str, float]
    free: tuple[str, ...]
    left: Floats
    without: Base | None = None

    @property
    def rig(self) -> Rig:
        """The rig."""
        return self.campaign.rig

    @cached_property
    def scales(self) -> dict[str, float]:
        """Size of each base quantity in the records."""
        own = {p.name: self.values[p.name] for p in (*self.rig.constants, *self.rig.parameters)}
        return characteristic_scales(
            self.rig, [_complete(self.rig, r) for r in self.campaign.estimation], own
        )

    def added(self, changed: Sequence[Record], reference: Sequence[Record]) -> float:
        """Return what a change of records adds to the error of the equations, in units of what they leave without it.

        What other numbers of the base equations would explain does not count. Of the equation in which most is added.

        Parameters
        ----------
        changed
            Records with an effect.
        reference
            The same stretches without it.
        """
        before, after = (
            _Fit(self.rig, _motions(self.rig, records, self.values), self.modelled, self.free)
            for records in (reference, changed)
        )
        return float(np.max(before.unexplained(after, self.values, self.left) / self.left))

    def size(self, name: str) -> float:
        """Return the RMS of an input or a reading in the records.

        Parameters
        ----------
        name
            Of the signal.
        """
        signals = [record[name] for record in self.campaign.estimation if name in record]
        return float(np.sqrt(np.mean(np.concatenate(signals) ** 2))) if signals else 0.0


def base_of(campaign: Campaign) -> Base:
    """Return the base equations of a campaign, with friction at the joint where it lowers their error most, or nowhere.

    Parameters
    ----------
    campaign
        With records whose sensors show the whole motion.

    Raises
    ------
    SimulationError
        If they do not, or a number that no regression gives is missing.
    """
    rig = campaign.rig
    held = held_numbers(rig) | ({campaign.absent_spring} if campaign.absent_spring else set())
    known = {**campaign.constants, **campaign.given}
    missing = sorted(name for name in held if name not in known)
    if missing:
        raise SimulationError(f"The campaign does not give {', '.join(missing)}.")
    start = {p.name: p.default if p.default is not None else 1.0 for p in rig.parameters} | known
    motions = _motions(rig, campaign.estimation, known)
    # An equation that no drive enters is solved by zeros: noise would pull its numbers there.
    held |= _of_undriven(motions, start)
    undriven = sorted(name for name in held if name not in known and name in start and start[name] != 0.0)
    if undriven:
        raise SimulationError(f"The campaign does not give {', '.join(undriven)}.")
    free = tuple(p.name for p in rig.parameters if p.name not in held and _matters(motions, start, p.name))
    if campaign.modelled:
        return _fitted(campaign, motions, start, free, campaign.modelled, is_chosen=False)
    best = plain = _fitted(campaign, motions, start, free, (), is_chosen=False)
    for joint in rig.mechanism.joints:
        effect = effect_named(FRICTION)
        effect = effect if rig.has_one_motion else placed(effect, joint.name)
        if not rig.offers(placed(effect_named(FRICTION), joint.name)):
            continue
        found = _fitted(campaign, motions, start, free, (effect,), is_chosen=True)
        if _size(found.left, plain.left) < min(_HELPS, _size(best.left, plain.left)):
            best = found
    # Strengths are in units of what the better equations leave.
    return replace(best, without=replace(plain, left=best.left)) if best.is_chosen else best


def held_numbers(rig: Rig) -> set[str]:
    """Return the names of the parameters that set the scale of all forces: those of the drives."""
    read = {
        s.name
        for drive in rig.mechanism.drives
        for s in (drive.force.free_symbols | drive.signal.free_symbols)
    }
    return {p.name for p in rig.parameters} & read


def _complete(rig: Rig, record: Record) -> Record:
    still = {s.name: np.zeros(record.n_samples) for s in rig.inputs if s.name not in record}
    return record.with_signals(**still) if still else record


def _motions(rig: Rig, records: Sequence[Record], known: Mapping[str, float]) -> list[RecordMotion]:
    found = [record_motion(rig, record, known) for record in records]
    motions = [motion for motion in found if motion is not None]
    if len(motions) < len(records):
        raise SimulationError(f"The sensors of a record do not show the whole motion of {rig.name}.")
    return motions


def _matters(motions: Sequence[RecordMotion], values: Mapping[str, float], name: str) -> bool:
    return any(bool(np.any(motion.slopes(values, [name]))) for motion in motions)


def _of_undriven(motions: Sequence[RecordMotion], values: Mapping[str, float]) -> set[str]:
    """Return the names of the parameters in equations of motion that no drive enters."""
    motion = motions[0]
    equations, rig = motion.equations, motion.equations.rig
    if not equations.n_coordinates:
        return set()
    p = equations.parameters(values, motion.record)
    along = equations.slopes_along(motion.z, motion.u, p)
    driven = np.any([np.any(along[drive.name], axis=1) for drive in rig.mechanism.drives], axis=0)
    names = [parameter.name for parameter in rig.parameters]
    slopes = motion.slopes(values, names)
    return {name for name, own in zip(names, slopes, strict=True) if np.any(own[~driven])}


def _size(left: Floats, unit: Floats) -> float:
    return float(np.sqrt(np.mean((left / unit) ** 2)))


def _fitted(
    campaign: Campaign,
    motions: Sequence[RecordMotion],
    start: Mapping[str, float],
    free: tuple[str, ...],
    modelled: tuple[Effect, ...],
    is_chosen: bool,
) -> Base:
    rig = campaign.rig
    structure = compose(rig, modelled)
    values = dict(start)
    if is_chosen:
        (effect,) = modelled
        name = structure.parameter_name(effect, "T_c")
        values[name], free = 0.0, (*free, name)
    fit = _Fit(rig, motions, modelled, free)
    left = fit.left(values)
    for _ in range(_ROUNDS):
        moved, _ = fit.step(values, left)
        now = fit.left(moved)
        better = _size(now, left)
        if not better < 1.0:
            break
        values, left = moved, now
        if better > 1.0 - _SETTLED:
            break
    if not np.all(np.isfinite(left)) or np.any(left <= 0.0):
        raise SimulationError(f"The equations of {rig.name} have no residual along these records.")
    return Base(campaign, modelled, is_chosen, values, free, left)


class _Fit:
    """The error of equations along motions as a function of their numbers."""

    def __init__(
        self, rig: Rig, motions: Sequence[RecordMotion], modelled: Sequence[Effect], free: Sequence[str]
    ) -> None:
        self.rig, self.motions, self.modelled, self.free = rig, motions, modelled, list(free)
        self.structure = compose(rig, modelled)
        parameters = {p.name: p for p in self.structure.parameters}
        self.bounds = [(parameters[name].lower, parameters[name].upper) for name in free]

    def _rows(self, values: Mapping[str, float]) -> list[Floats]:
        rows = []
        for motion in self.motions:
            own = motion.left(values)
            for effect in self.modelled:
                own = own + self._generalized(motion, effect, self._own(effect, values), values)
            rows.append(motion.filtered(own))
        return rows

    def left(self, values: Mapping[str, float]) -> Floats:
        """Return the RMS of each equation."""
        return _rms(self._rows(values))

    def step(self, values: Mapping[str, float], unit: Floats) -> tuple[dict[str, float], Floats]:
        """Return numbers that are better where the equations are linear in them, and what these would leave there."""
        rows = self._rows(values)
        by = [self._slopes(motion, values) for motion in self.motions]
        weight = np.where(unit > 0.0, unit, 1.0)[:, None]
        target = np.concatenate([(own / weight).ravel() for own in rows])
        matrix = np.concatenate([(own / weight).reshape(len(self.free), -1) for own in by], axis=1).T
        size = np.sqrt(np.mean(matrix**2, axis=0))
        size[size == 0.0] = 1.0
        now = np.array([values[name] for name in self.free])
        ends = np.array(self.bounds).reshape(-1, 2)
        q, r = np.linalg.qr(matrix / size)
        # Directions that nothing determines stay where they are.
        held = _RANK * float(np.max(np.abs(r), initial=0.0)) * np.eye(r.shape[1])
        low, high = (ends[:, 0] - now) * size, (ends[:, 1] - now) * size
        narrow = high <= low
        high = np.where(narrow, low + 1e-12 * np.maximum(1.0, np.abs(low)), high)
        if self.free:
            change = lsq_linear(
                np.concatenate([r, held]), -np.r_[q.T @ target, np.zeros(len(held))], (low, high)
            ).x
        else:
            change = np.zeros(0)
        moved = dict(zip(self.free, map(float, now + change / size), strict=True))
        after = target + (matrix / size) @ change
        parts, first = [], 0
        for own in rows:
            parts.append(after[first : first + own.size].reshape(own.shape) * weight)
            first += own.size
        return {**values, **moved}, _rms(parts)

    def unexplained(self, changed: _Fit, values: Mapping[str, float], unit: Floats) -> Floats:
        """Return the RMS of the change of each equation that no numbers of these equations explain.

        Parameters
        ----------
        changed
            The same equations along changed motions.
        values
            Numbers at which both are evaluated.
        unit
            Of each equation.
        """
        pairs = zip(self._rows(values), changed._rows(values), strict=True)
        changes = [after - before for before, after in pairs]
        weight = unit[:, None]
        target = np.concatenate([(own / weight).ravel() for own in changes])
        if self.free:
            by = [self._slopes(motion, values) / weight for motion in self.motions]
            matrix = np.concatenate([own.reshape(len(self.free), -1) for own in by], axis=1).T
            size = np.sqrt(np.mean(matrix**2, axis=0))
            matrix = matrix / np.where(size > 0.0, size, 1.0)
            target = target - matrix @ np.linalg.lstsq(matrix, target, rcond=_RANK)[0]
        parts, first = [], 0
        for own in changes:
            parts.append(target[first : first + own.size].reshape(own.shape) * weight)
            first += own.size
        return _rms(parts)

    def _slopes(self, motion: RecordMotion, values: Mapping[str, float]) -> Floats:
        of_rig = [name for name in self.free if name in motion.equations.structure.names]
        found = list(motion.slopes(values, of_rig)) if of_rig else []
        for effect in self.modelled:
            for p in effect.parameters:
                if self.structure.parameter_name(effect, p.name) in self.free:
                    # Dry friction, which is linear in its number.
                    found.append(self._generalized(motion, effect, {p.name: 1.0}, values))
        return motion.filtered(np.array(found)) if found else np.zeros((0, 1, motion.record.n_samples))

    def _own(self, effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
        return {p.name: values[self.structure.parameter_name(effect, p.name)] for p in effect.parameters}

    def _generalized(
        self, motion: RecordMotion, effect: Effect, own: Mapping[str, float], values: Mapping[str, float]
    ) -> Floats:
        return generalized(
            motion, effect, own, values, joint_motion(motion, joint_of(self.rig, effect), values)
        )


def generalized(
    motion: RecordMotion,
    effect: Effect,
    own: Mapping[str, float],
    values: Mapping[str, float],
    moved: JointMotion,
) -> Floats:
    """Return what an effect adds to `RecordMotion.left`.

    Parameters
    ----------
    motion
        Of the rig.
    effect
        At a joint.
    own
        Its parameters by their own names.
    values
        Constants and parameters of the rig.
    moved
        Motion of the joint.
    """
    equations = motion.equations
    joint: Joint = joint_of(equations.rig, effect)
    force = effect_force(effect, own, moved)
    if equations.n_coordinates:
        p = equations.parameters(values, motion.record)
        return np.asarray(equations.slopes_along(motion.z, motion.u, p)[joint.name] * force)
    reading = [s.name for s in equations.rig.mechanism.sensors if f"force({joint.name})" in str(s.reads)]
    names = [equations.sensor_names[i] for i in motion.sensors]
    return np.array([force if name in reading else np.zeros_like(force) for name in names])


def _rms(rows: Sequence[Floats]) -> Floats:
    return np.asarray(np.sqrt(np.mean(np.concatenate(rows, axis=1) ** 2, axis=1)))
