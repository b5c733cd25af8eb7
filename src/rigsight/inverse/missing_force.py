"""The force that the equations leave along the measured motion, joint by joint and before any law.

A force of any shape at one joint pushes the equations of motion in one direction at a time. The share of their residual in that
direction says how well this joint alone explains it; what noise of the sensors does to it counts in no direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import SimulationError
from rigsight.inverse.equation_fit import EquationFit, per_force, record_motions
from rigsight.inverse.joint_force import joint_motion
from rigsight.inverse.measured_motion import WIDER, RecordMotion
from rigsight.records import Record
from rigsight.rigs import Joint

Floats = NDArray[np.float64]

_CLASSES, _CLASS_ROWS = 24, 8
"""Number of classes, by displacement or velocity, over which a force is averaged at most, and of rows in each at least."""
_SEED = 0
"""The noise of a weight is the same for equal records: a diagnosis depends on its records alone."""


@dataclass(frozen=True)
class MeanForce:
    """Mean of a force over a signal, in classes with equally many rows, with its standard error."""

    signal: tuple[float, ...]
    force: tuple[float, ...]
    std: tuple[float, ...]

    def to_json(self) -> dict[str, list[float]]:
        """Return plain data."""
        return {"signal": list(self.signal), "force": list(self.force), "std": list(self.std)}


@dataclass(frozen=True, eq=False)
class MissingForce:
    """Force that must be missing at a joint if it is missing at this joint alone.

    Attributes
    ----------
    where
        The joint.
    motion_unit, unit
        Of its displacement and of the force.
    share
        Of the squared residual of the equations above the noise of the sensors that a force of any shape there explains.
    rms
        Of the force.
    records, time, displacement, velocity, force
        Nearly independent samples, shape (n_rows,): name of the record, time, displacement from rest and velocity of the joint,
        and the force, positive where it resists the motion.
    """

    where: str
    motion_unit: str
    unit: str
    share: float
    rms: float
    records: tuple[str, ...]
    time: Floats
    displacement: Floats
    velocity: Floats
    force: Floats

    def over(self, signal: Floats) -> MeanForce:
        """Return the mean force in classes of a signal, shape (n_rows,)."""
        n_classes = min(_CLASSES, max(1, signal.size // _CLASS_ROWS))
        parts = [part for part in np.array_split(np.argsort(signal, kind="stable"), n_classes) if part.size]
        # Forces hold overtones of the motion, and what laws leave moves with it: rows in its band are independent.
        stds = [float(np.std(self.force[part]) * np.sqrt(WIDER / part.size)) for part in parts]
        return MeanForce(
            tuple(float(np.mean(signal[part])) for part in parts),
            tuple(float(np.mean(self.force[part])) for part in parts),
            tuple(stds),
        )

    def to_json(self) -> dict[str, Any]:
        """Return an entry of ``missing_force.joints`` in ``diagnosis.json``."""
        return {
            "where": self.where,
            "share": self.share,
            "rms": {"value": self.rms, "unit": self.unit},
            "over_displacement": self.over(self.displacement).to_json(),
            "over_velocity": self.over(self.velocity).to_json(),
            "units": {"displacement": self.motion_unit, "velocity": f"{self.motion_unit}/s"},
        }


@dataclass(frozen=True, eq=False)
class ForceAlong:
    """A force at one joint that makes the equations hold as well as one there can.

    Attributes
    ----------
    joint
        Its name.
    force
        Along each motion, in the band in which forces are compared, shape (n_samples,); positive where it resists the motion.
    std
        RMS of its standard error.
    share
        Of the squared residual of the equations above the noise of the sensors that it explains.
    """

    joint: str
    force: tuple[Floats, ...]
    std: float
    share: float


def missing_forces(
    fit: EquationFit, values: Mapping[str, float], covariance: Floats | None
) -> tuple[MissingForce, ...]:
    """Return the missing force at each joint at nearly independent samples, the one that explains most first.

    Parameters
    ----------
    fit
        Equations and motions.
    values
        Constants and parameters of the equations.
    covariance
        Of the rows by noise of the sensors, see `noise_of_rows`; None: every equation counts in units of its own residual.
    """
    joints = {joint.name: joint for joint in fit.rig.mechanism.joints}
    return tuple(
        _missing(fit, values, along, joints[along.joint]) for along in forces_along(fit, values, covariance)
    )


def forces_along(
    fit: EquationFit, values: Mapping[str, float], covariance: Floats | None
) -> list[ForceAlong]:
    """Return the missing force at each joint, the one that explains most first; parameters as of `missing_forces`."""
    rows = [motion.thinned(fit.residual(motion, values)) for motion in fit.motions]
    if covariance is None:
        weight = np.diag([1.0 / max(float(np.mean(own**2)), 1e-300) for own in np.concatenate(rows, axis=1)])
    else:
        weight = np.linalg.pinv(covariance, hermitian=True)
    n_equations, n_rows = weight.shape[0], sum(own.shape[1] for own in rows)
    whole = sum(float(np.einsum("it,ij,jt->", own, weight, own)) for own in rows) - n_equations * n_rows
    found = []
    for joint in fit.rig.mechanism.joints:
        forces, sizes, explained = [], [], -float(n_rows)
        for motion in fit.motions:
            # The direction of a force: that of a motion that drifts is none of its slow part.
            along = motion.smoothed(per_force(motion, joint, values))
            own = motion.filtered(fit.residual(motion, values))
            size = np.maximum(np.einsum("it,ij,jt->t", along, weight, along), np.finfo(np.float64).tiny)
            pushed = np.einsum("it,ij,jt->t", along, weight, own)
            explained += float(np.sum(motion.some(pushed**2 / size)))
            forces.append(-pushed / size)
            sizes.append(size)
        share = float(np.clip(explained / whole, 0.0, 1.0)) if whole > 0.0 else 0.0
        std = float(np.sqrt(np.mean(1.0 / np.concatenate(sizes))))
        found.append(ForceAlong(joint.name, tuple(forces), std, share))
    return sorted(found, key=lambda own: -own.share)


def _missing(fit: EquationFit, values: Mapping[str, float], along: ForceAlong, joint: Joint) -> MissingForce:
    motions, units = fit.motions, fit.rig.units_at(joint.name)
    moved = [joint_motion(motion, joint, values) for motion in motions]
    parts = [motion.some(own) for motion, own in zip(motions, along.force, strict=True)]
    force = np.concatenate(parts)
    times = [m.record.dt * np.arange(m.record.n_samples, dtype=np.float64) for m in motions]
    time, x, v = (
        np.concatenate([m.thinned(signal) for m, signal in zip(motions, own, strict=True)])
        for own in (times, [j.x for j in moved], [j.v for j in moved])
    )
    names = [m.record.name for m, own in zip(motions, parts, strict=True) for _ in own]
    rms = float(np.sqrt(np.mean(force**2)))
    return MissingForce(
        joint.name, units["x"], units["force"], along.share, rms, tuple(names), time, x, v, force
    )


def noise_of_rows(fit: EquationFit, values: Mapping[str, float], noise: Mapping[str, float]) -> Floats | None:
    """Return the covariance of the rows of all equations that noise of the sensors causes, shape (n_equations, n_equations).

    None where the noise of a sensor is not known.
    """
    read = [s.name for s in fit.rig.outputs if all(s.name in motion.record for motion in fit.motions)]
    if not read or not all(noise.get(name, 0.0) > 0.0 for name in read):
        return None
    rng = np.random.default_rng(_SEED)
    noisy = [_with_noise(motion, {name: noise[name] for name in read}, rng) for motion in fit.motions]
    try:
        moved = record_motions(fit.rig, noisy, values)
    except SimulationError:
        return None
    changes = [
        motion.thinned(fit.residual(other, values) - fit.residual(motion, values))
        for motion, other in zip(fit.motions, moved, strict=True)
    ]
    return np.atleast_2d(np.cov(np.concatenate(changes, axis=1)))


def _with_noise(motion: RecordMotion, noise: Mapping[str, float], rng: np.random.Generator) -> Record:
    record = motion.record
    drawn = {name: record[name] + rng.normal(0.0, std, record.n_samples) for name, std in noise.items()}
    return record.with_signals(**drawn)
