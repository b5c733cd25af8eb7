"""Numbers of the equations of motion by regression along the measured motion, and the forces that they leave unexplained."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from rigsight.effects import Effect, symbols
from rigsight.errors import SimulationError
from rigsight.inverse.drive_gain import changed, gains_of_known_scale, weighed
from rigsight.inverse.joint_force import JointMotion, effect_force, joint_motion
from rigsight.inverse.measured_motion import RecordMotion, record_motion
from rigsight.records import Record
from rigsight.rigs import Joint, Rig
from rigsight.rigs.rig import joint_of
from rigsight.simulate import compose

Floats = NDArray[np.float64]

_ROUNDS = 12
_SETTLED = 1e-6
_RANK = 1e-9
_DEPENDENT = 1e-6
LAW_ERROR = 0.05
"""Error of laws relative to the force in an equation (an assumption). It weighs the joints of a rig against each other: one whose
equation holds would else count as much as one whose friction is missing."""
_UNBOUNDED = 1e18
_APART = 1e-12
"""Least distance of two bounds, relative to them, that the solver accepts."""


def held_numbers(rig: Rig) -> set[str]:
    """Return the names of the parameters that set the scale of all forces: those of the drives."""
    read = {
        s.name
        for drive in rig.mechanism.drives
        for s in (drive.force.free_symbols | drive.signal.free_symbols)
    }
    return {p.name for p in rig.parameters} & read


def with_all_inputs(rig: Rig, record: Record) -> Record:
    """Return a record with every input of a rig; what it does not hold is zero."""
    still = {s.name: np.zeros(record.n_samples) for s in rig.inputs if s.name not in record}
    return record.with_signals(**still) if still else record


def record_motions(rig: Rig, records: Sequence[Record], known: Mapping[str, float]) -> list[RecordMotion]:
    """Return the motion along each record; raises `SimulationError` where the sensors do not show it."""
    found = [record_motion(rig, record, known) for record in records]
    motions = [motion for motion in found if motion is not None]
    if len(motions) < len(records):
        raise SimulationError(f"The sensors of a record do not show the whole motion of {rig.name}.")
    return motions


def matters(motions: Sequence[RecordMotion], values: Mapping[str, float], name: str) -> bool:
    """Return True if a parameter has an influence on the equations along the motions."""
    slopes = [(motion, motion.slopes(values, [name])) for motion in motions]
    # Of a motion that drifts the filter leaves nothing of a constant force but rounding.
    return any(_largest(motion.filtered(own)) > _RANK * _largest(own) for motion, own in slopes)


def identifiable(
    rig: Rig,
    motions: Sequence[RecordMotion],
    modelled: Sequence[Effect],
    values: Mapping[str, float],
    held: Collection[str],
) -> tuple[str, ...]:
    """Return the parameters that the equations determine along the motions, beside those that are held.

    Those of modelled effects are the linear ones of effects that do not read the displacement.
    """
    structure = compose(rig, modelled)
    free = [p.name for p in rig.parameters if p.name not in held and matters(motions, values, p.name)]
    # A modelled spring law would take the stiffness of a missing loop.
    without_springs = [effect for effect in modelled if not effect.reads(symbols.x)]
    free += [
        structure.parameter_name(effect, p.name)
        for effect in without_springs
        for p in effect.linear_parameters
    ]
    # Of numbers that do the same the last one stays as it is known: the rest of a spring beside a constant force, or a gain.
    of_rest = {symbol.name for joint in rig.mechanism.joints for symbol in joint.rest.free_symbols}
    of_drives = held_numbers(rig)
    ordered = sorted(free, key=lambda name: (name in of_drives, name in of_rest))
    return EquationFit(rig, motions, modelled, ordered, values).independent(values)


def undriven_inertias(motions: Sequence[RecordMotion], values: Mapping[str, float]) -> set[str]:
    """Return the names of the parameters of the kinetic energy in equations that no drive and no known weight enters.

    They set the scale of these equations.
    """
    motion = motions[0]
    equations, rig = motion.equations, motion.equations.rig
    if not equations.n_coordinates:
        return set()
    p = equations.parameters(values, motion.record)
    along = equations.slopes_along(motion.z, motion.u, p)
    driven = np.any([np.any(along[drive.name], axis=1) for drive in rig.mechanism.drives], axis=0) | weighed(
        rig
    )
    moved = {symbol.name for symbol in rig.mechanism.kinetic.free_symbols}
    names = [parameter.name for parameter in rig.parameters if parameter.name in moved]
    slopes = motion.slopes(values, names)
    return {name for name, own in zip(names, slopes, strict=True) if np.any(own[~driven])}


class EquationFit:
    """The error of equations along motions as a function of their numbers.

    Where the gain of a drive is free, residuals are in units of its input, times the gain at `values`.
    """

    def __init__(
        self,
        rig: Rig,
        motions: Sequence[RecordMotion],
        modelled: Sequence[Effect],
        free: Sequence[str],
        values: Mapping[str, float],
    ) -> None:
        self.rig, self.motions, self.modelled, self.free = rig, motions, modelled, list(free)
        self.gains = {
            name: (values[name], np.array(rows)[:, None])
            for name, rows in gains_of_known_scale(rig).items()
            if name in self.free
        }
        self.structure = compose(rig, modelled)
        parameters = {p.name: p for p in self.structure.parameters}
        self.bounds = [(parameters[name].lower, parameters[name].upper) for name in free]

    def rows(self, values: Mapping[str, float]) -> list[Floats]:
        """Return the residual of each equation along each motion, in the band of the motion."""
        return [motion.where_moving(self.residual(motion, values)) for motion in self.motions]

    def residual(self, motion: RecordMotion, values: Mapping[str, float]) -> Floats:
        """Return the residual of each equation along one motion in its whole band, shape (n_equations, n_samples)."""
        return self._force(motion, values) * self.per_input(values)

    def _force(self, motion: RecordMotion, values: Mapping[str, float]) -> Floats:
        own = motion.residual(values)
        for effect in self.modelled:
            own = own + self._along(motion, effect, self._own(effect, values), values)
        return own

    def per_input(self, values: Mapping[str, float]) -> Floats:
        """Return the factors that bring the forces in each equation to units of the input, shape (n_equations or 1, 1)."""
        factor = np.ones((1, 1))
        for name, (gain, rows) in self.gains.items():
            factor = factor * np.where(rows, gain / values[name], 1.0)
        return factor

    def rms(self, values: Mapping[str, float]) -> Floats:
        """Return the RMS of each equation."""
        return _rms(self.rows(values))

    def tolerance(self, values: Mapping[str, float], noise: Floats | None = None) -> Floats:
        """Return the error of each equation that laws and noise leave at least.

        Parameters
        ----------
        values
            Constants and parameters of the equations.
        noise
            Variance of each equation by noise of the sensors.
        """
        parts = zip(*(motion.forces(values) for motion in self.motions), strict=True)
        filtered = [
            [m.where_moving(own) for m, own in zip(self.motions, part, strict=True)] for part in parts
        ]
        size = np.max([_rms(part) for part in filtered], axis=0)
        error = np.sqrt((LAW_ERROR * size) ** 2 + (0.0 if noise is None else noise))
        return np.asarray(np.maximum(error, _DEPENDENT * np.max(error)))

    def settled(self, start: Mapping[str, float]) -> tuple[dict[str, float], Floats]:
        """Return the numbers with the smallest residual near a start, and its RMS in each equation.

        Raises
        ------
        SimulationError
            If the equations cannot be evaluated along the motions, or leave nothing at all.
        """
        values, remainder = dict(start), self.rms(start)
        for _ in range(_ROUNDS):
            moved = self.step(values, remainder)
            now = self.rms(moved)
            better = size_in(now, remainder)
            if not better < 1.0:
                break
            values, remainder = moved, now
            if better > 1.0 - _SETTLED:
                break
        if not np.all(np.isfinite(remainder)) or np.any(remainder <= 0.0):
            raise SimulationError(f"The equations of {self.rig.name} have no residual along these records.")
        return values, remainder

    def step(self, values: Mapping[str, float], unit: Floats) -> dict[str, float]:
        """Return numbers that are better where the equations are linear in them; residuals count in the given units."""
        if not self.free:
            return dict(values)
        weight = np.where(unit > 0.0, unit, 1.0)[:, None]
        target = _joined([row / weight for row in self.rows(values)])
        matrix, size = self._influences(values, weight)
        now = np.array([values[name] for name in self.free])
        ends = np.array(self.bounds)
        q, r = np.linalg.qr(matrix)
        # Directions that nothing determines stay where they are.
        held = _RANK * float(np.max(np.abs(r), initial=0.0)) * np.eye(r.shape[1])
        # The regression is linear in the reciprocal of a gain.
        is_gain = np.array([name in self.gains for name in self.free])
        ends[is_gain] = -_UNBOUNDED, _UNBOUNDED
        low, high = (ends[:, 0] - now) * size, (ends[:, 1] - now) * size
        narrow = high <= low
        high = np.where(narrow, low + _APART * np.maximum(1.0, np.abs(low)), high)
        change = lsq_linear(
            np.concatenate([r, held]), -np.r_[q.T @ target, np.zeros(len(held))], (low, high), method="bvls"
        ).x
        moved = np.clip(changed(now, change / size, is_gain), *np.array(self.bounds).T)
        return {**values, **dict(zip(self.free, map(float, moved), strict=True))}

    def independent(self, values: Mapping[str, float]) -> tuple[str, ...]:
        """Return the free numbers whose influence is not a sum of the influences of those before them."""
        if not self.free:
            return ()
        matrix, _ = self._influences(values, np.ones((1, 1)))
        own = np.abs(np.diag(np.linalg.qr(matrix, mode="r")))
        enough = _DEPENDENT * float(np.max(own, initial=0.0))
        return tuple(name for name, part in zip(self.free, own, strict=True) if part > enough)

    def _influences(self, values: Mapping[str, float], weight: Floats) -> tuple[Floats, Floats]:
        """Return the derivatives of all residuals by the free numbers as columns of RMS one, and the RMS that they had."""
        slopes = [motion.where_moving(self.slopes(motion, values)) / weight for motion in self.motions]
        matrix = np.concatenate([own.reshape(len(self.free), -1) for own in slopes], axis=1).T
        size = np.sqrt(np.mean(matrix**2, axis=0))
        size[size == 0.0] = 1.0
        return matrix / size, size

    def unexplained(self, changed: EquationFit, values: Mapping[str, float], unit: Floats) -> Floats:
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
        weight = unit[:, None]
        # In the band of the motion that was measured: a changed one may have another.
        changes = [
            before.where_moving(changed.residual(after, values) - self.residual(before, values)) / weight
            for before, after in zip(self.motions, changed.motions, strict=True)
        ]
        target = _joined(changes)
        if self.free:
            matrix, _ = self._influences(values, weight)
            target = target - matrix @ np.linalg.lstsq(matrix, target, rcond=_RANK)[0]
        ends = np.cumsum([own.size for own in changes])[:-1]
        parts = [
            part.reshape(own.shape) * weight
            for part, own in zip(np.split(target, ends), changes, strict=True)
        ]
        return _rms(parts)

    def slopes(self, motion: RecordMotion, values: Mapping[str, float]) -> Floats:
        """Return the derivatives of `residual` by the free numbers along one motion, shape (n_free, n_equations, n_samples)."""
        of_rig = [name for name in self.free if name in motion.equations.structure.names]
        found = dict(zip(of_rig, motion.slopes(values, of_rig) if of_rig else [], strict=True))
        for effect in self.modelled:
            without = {**self._own(effect, values), **{p.name: 0.0 for p in effect.linear_parameters}}
            for p in effect.linear_parameters:
                name = self.structure.parameter_name(effect, p.name)
                if name in self.free:
                    found[name] = self._along(motion, effect, {**without, p.name: 1.0}, values)
        if not found:
            return np.zeros((0, *motion.residual(values).shape))
        for name, (_, rows) in self.gains.items():
            found[name] = found[name] - np.where(rows, self._force(motion, values) / values[name], 0.0)
        return np.array([found[name] for name in self.free]) * self.per_input(values)

    def _own(self, effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
        return {p.name: values[self.structure.parameter_name(effect, p.name)] for p in effect.parameters}

    def _along(
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
    """Return what an effect adds to `RecordMotion.residual`.

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
    joint = joint_of(motion.equations.rig, effect)
    return per_force(motion, joint, values) * effect_force(effect, own, moved)


def per_force(motion: RecordMotion, joint: Joint, values: Mapping[str, float]) -> Floats:
    """Return what a unit of force that resists the motion of a joint adds to `RecordMotion.residual`, of the same shape."""
    equations = motion.equations
    if equations.n_coordinates:
        p = equations.parameters(values, motion.record)
        return np.asarray(equations.slopes_along(motion.z, motion.u, p)[joint.name])
    reading = [s.name for s in equations.rig.mechanism.sensors if f"force({joint.name})" in str(s.reads)]
    names = [equations.sensor_names[i] for i in motion.sensors]
    one = np.ones(motion.record.n_samples)
    return np.array([one if name in reading else np.zeros_like(one) for name in names])


def _largest(rows: Floats) -> float:
    return float(np.max(np.abs(rows), initial=0.0))


def _joined(rows: Sequence[Floats]) -> Floats:
    return np.concatenate([own.ravel() for own in rows])


def size_in(remainder: Floats, unit: Floats) -> float:
    """Return residuals of equations in units of other ones, as one number."""
    return float(np.sqrt(np.mean((remainder / unit) ** 2)))


def _rms(rows: Sequence[Floats]) -> Floats:
    return np.asarray(np.sqrt(np.mean(np.concatenate(rows, axis=1) ** 2, axis=1)))
