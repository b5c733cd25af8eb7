"""Sensor responses to forces with known time histories at a joint: rows for a regression, whitened like the measurements.

The terms are filtered through the linearized equations of the rig, rather than the records through their inverse: no signal is
differentiated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.discover.joints.followed_motion import BREADTH, FollowedMotion, prior_spread
from rigsight.discover.joints.force_observer import cases_of, gains_of, whitened
from rigsight.discover.regression import N_BLOCKS, Projected
from rigsight.records.record import Floats, Record

_DECADES = (4.0, 1.0, -2.0, -5.0, -10.0)
"""Intensities of the unknown force that a law leaves, in the same units as for the whole force; the last is practically zero."""


@dataclass(frozen=True, eq=False)
class SensorRegression:
    """Regression of the sensor readings on parameters and terms, for one intensity of the remaining unknown force."""

    projected: Projected  # target, and the rig's parameters as columns that are always included
    columns: Floats  # one for each term, shape (n_rows, n_terms)
    fitted: tuple[str, ...]  # names of the parameters of the columns of `projected`
    logarithms: float  # sum of the logarithms of the variances that the rows were divided by
    decade: float  # common logarithm of that intensity

    def criterion(self, remainder: float, n_terms: int) -> float:
        """Return the Bayesian information criterion of an equation with a residual sum of squares and a number of terms."""
        return self.logarithms + remainder + n_terms * float(np.log(self.projected.independent))


def sensor_regressions(
    followed: Sequence[FollowedMotion],
    records: Sequence[Record],
    noise: Floats,
    signals: Sequence[Sequence[Floats]],
) -> list[tuple[SensorRegression, ...]]:
    """Return the regressions of each joint, the largest intensity first."""
    n_records, forces = len(records), followed[0].forces
    ((force, rate),) = forces
    linear = [
        one.equations.about(record, one.values, _without(motion, (force, rate)))
        for one in followed
        for record, motion in zip(records, one.motions, strict=True)
    ]
    sizes = [one.sizes for one in followed for _ in records]
    jumps = [own for one in followed for own in one.jumps]
    cases = cases_of(linear, noise, sizes, forces, BREADTH, jumps, lasting=False)
    tried = np.array([[one.omega] for one in followed for _ in records]) * 10.0 ** np.array([_DECADES])
    gains = gains_of(cases, tried)
    longest, n_cases, n_outputs, n = cases.seen.shape
    known = cases.data.shape[3]
    n_columns = known + max(own[0].shape[1] for own in signals)
    course = np.zeros((longest, n_cases, n_columns - known))
    slopes = np.zeros_like(course)
    for case, signal in enumerate(signal for of_joint in signals for signal in of_joint):
        count, n_own = signal.shape
        course[:count, case, :n_own] = signal / sizes[case][force]
        slopes[: count - 1, case, :n_own] = np.diff(signal, axis=0) / linear[case].dt / sizes[case][rate]
    others = np.setdiff1d(np.arange(n), (force, rate))
    moved = np.zeros((n_cases, n, n_columns))
    shown = np.zeros((n_cases, n_outputs, n_columns))

    def drive(k: int) -> Floats:
        moved[:, :, :known] = cases.drive[k]
        step = cases.transition[k][:, others]
        moved[:, others, known:] = -(
            step[:, :, force, None] * course[k, :, None, :] + step[:, :, rate, None] * slopes[k, :, None, :]
        )
        return moved

    def data(k: int) -> Floats:
        shown[:, :, :known] = cases.data[k]
        shown[:, :, known:] = cases.seen[k, :, :, force, None] * course[k, :, None, :]
        return shown

    length = -(-longest // max(1, N_BLOCKS // n_records))
    rows = np.zeros((n_cases, tried.shape[1], length * n_outputs, n_columns))
    blocks: list[Floats] = []

    def tell(sample: int, sensor: int, row: Floats) -> None:
        rows[:, :, (sample % length) * n_outputs + sensor] = row
        if sensor == n_outputs - 1 and (sample == longest - 1 or sample % length == length - 1):
            rows[:, :, (sample % length + 1) * n_outputs :] = 0.0
            blocks.append(_short(rows))

    whitened(cases, gains, drive, data, tell)
    # Intensity first, then blocks of rows of all records.
    together = np.moveaxis(np.array(blocks), 2, 0)
    found = []
    for i, (one, own) in enumerate(zip(followed, signals, strict=True)):
        mine = slice(i * n_records, (i + 1) * n_records)
        logarithms = np.sum(gains.log_variances[mine], axis=0)
        independent = int(np.sum(cases.n_measured[mine]))
        columns = known + own[0].shape[1]
        found.append(
            tuple(
                _regression(
                    one, q[:, mine, :, :columns].reshape(-1, columns), known, lost, decade, independent
                )
                for q, lost, decade in zip(together, logarithms, _DECADES, strict=True)
            )
        )
    return found


def _without(motion: Floats, force: tuple[int, int]) -> Floats:
    """Return the reference with the same motion but without the force, because the law is to explain all of it."""
    bare = motion.copy()
    bare[:, list(force)] = 0.0
    return bare


def _short(rows: Floats) -> Floats:
    """Return as many rows as columns with the same normal equations."""
    n_columns = rows.shape[-1]
    if rows.shape[-2] < n_columns:
        rows = np.concatenate(
            [rows, np.zeros((*rows.shape[:-2], n_columns - rows.shape[-2], n_columns))], axis=-2
        )
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _regression(
    followed: FollowedMotion, rows: Floats, known: int, logarithms: float, decade: float, independent: int
) -> SensorRegression:
    """Add the prior of the parameters as rows; a parameter that affects no sensor is left out."""
    squares = np.sum(rows**2, axis=0)
    spread = prior_spread(followed, float(squares[0]), squares[1:known])
    before = np.zeros((known - 1, rows.shape[1]))
    before[:, 0] = -followed.offsets / spread
    before[:, 1:known] = np.diag(1.0 / spread)
    answered = np.flatnonzero(squares[1:known] > 0.0)
    rows = np.vstack([rows, before[answered]])
    projected = Projected(rows[:, 1 + answered], rows[:, 0], float(independent))
    names = tuple(followed.fitted[i].name for i in answered)
    return SensorRegression(projected, rows[:, known:], names, float(logarithms), decade)
