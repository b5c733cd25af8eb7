"""Motion and unknown force that agree best with the sensors: Kalman filter and smoother about a reference motion.

The unknown force is a state of the structure, an integrated random walk. Many cases (joints, records, intensities of the walk)
are filtered side by side. Changes of parameters pass through the same smoother as further columns, because it is linear: they
show how the estimated motion and force would change with each parameter.

References
----------
G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation* (Academic Press 1977), for the smoother with adjoint
states; P. de Jong, Ann. Stat. 19 (1991) 1073, for the further columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.discover.linearized_motion import LinearizedMotion
from rigsight.records.record import Floats

_EVENED = 64
"""Samples after which the covariance is made symmetric again, which rounding errors disturb."""


@dataclass(frozen=True, eq=False)
class Cases:
    """Linearized motions of one structure or of structures with equal shapes, scaled so that noise and states are about one.

    Axis 0 is time, axis 1 the case. Cases shorter than the longest one are padded with samples without measurement.
    """

    transition: Floats  # shape (n_samples - 1, n_cases, n_states, n_states)
    # Derivative of the readings by the state, shape (n_samples, n_cases, n_outputs, n_states); zero where
    # nothing was measured.
    seen: Floats
    # Known changes of the next state by column, shape (n_samples - 1, n_cases, n_states, n_columns).
    drive: Floats
    # Direct part of each column in the readings, shape (n_samples, n_cases, n_outputs, n_columns).
    data: Floats
    start: Floats  # covariance of the first state, shape (n_cases, n_states, n_states)
    # Covariance that an intensity of one adds from sample to sample, shape (n_cases, n_states, n_states).
    walk: Floats
    jump: Floats  # directions in which the state may jump after some samples, shape (n_states, n_directions)
    jumps: NDArray[np.bool_]  # true for the samples after which it may, shape (n_samples, n_cases)


def cases_of(
    motions: Sequence[LinearizedMotion],
    noise: Floats,
    sizes: Sequence[Floats],
    forces: Sequence[tuple[int, int]],
    breadth: float,
    jumps: Sequence[NDArray[np.bool_] | None],
) -> Cases:
    """Bring linearized motions into one form; the first column is the measured residual, the others are the parameters."""
    longest = max(motion.residual.shape[0] for motion in motions)
    n_cases, (n_outputs, n) = len(motions), motions[0].seen.shape[1:]
    n_columns = 1 + motions[0].by_parameter.shape[2]
    transition = np.tile(np.eye(n), (longest - 1, n_cases, 1, 1))
    seen = np.zeros((longest, n_cases, n_outputs, n))
    drive = np.zeros((longest - 1, n_cases, n, n_columns))
    data = np.zeros((longest, n_cases, n_outputs, n_columns))
    walk = np.zeros((n_cases, n, n))
    leaps = np.zeros((longest, n_cases), dtype=bool)
    for case, (motion, size, own_jumps) in enumerate(zip(motions, sizes, jumps, strict=True)):
        count = motion.residual.shape[0]
        known = np.isfinite(motion.residual)
        transition[: count - 1, case] = motion.transition * (size[None, :] / size[:, None])
        seen[:count, case] = np.where(known[:, :, None], motion.seen * size / noise[:, None], 0.0)
        drive[: count - 1, case, :, 0] = motion.defect / size
        drive[: count - 1, case, :, 1:] = -motion.by_parameter / size[:, None]
        data[:count, case, :, 0] = np.where(known, motion.residual / noise, 0.0)
        data[:count, case, :, 1:] = np.where(
            known[:, :, None], motion.seen_by_parameter / noise[:, None], 0.0
        )
        if own_jumps is not None:
            leaps[:count, case] = own_jumps
        dt = motion.dt
        own = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        for force, rate in forces:
            unit = np.array([size[force], size[rate]])
            walk[case][np.ix_([force, rate], [force, rate])] = own * size[rate] ** 2 / np.outer(unit, unit)
    start = np.tile(breadth**2 * np.eye(n), (n_cases, 1, 1))
    jump = np.eye(n)[:, [force for force, _ in forces]]
    return Cases(transition, seen, drive, data, start, walk, jump, leaps)


@dataclass(frozen=True, eq=False)
class Gains:
    """Gains and variances of a filter, shape (n_samples, n_cases, n_intensities, ...) each."""

    gain: Floats  # change of the state by each reading, (..., n_outputs, n_states)
    variance: Floats  # of the prediction error of each reading, (..., n_outputs)
    # Covariance before the readings of a sample are used, (..., n_states, n_states); empty unless requested.
    predicted: Floats

    @property
    def log_variances(self) -> Floats:
        """Sum of the logarithms of all variances, shape (n_cases, n_intensities)."""
        # An intensity at which rounding made a variance negative has no likelihood.
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sum(np.log(self.variance), axis=(0, 3)))


def gains_of(cases: Cases, intensities: Floats, keep: bool = False) -> Gains:
    """Compute covariances and gains along the records."""
    n_samples, n_cases, n_outputs, n = cases.seen.shape
    n_q = intensities.shape[1]
    gain = np.zeros((n_samples, n_cases, n_q, n_outputs, n))
    variance = np.ones((n_samples, n_cases, n_q, n_outputs))
    predicted = np.zeros((n_samples if keep else 0, n_cases, n_q, n, n))
    walk = intensities[:, :, None, None] * cases.walk[:, None]
    spread = np.repeat(cases.start[:, None], n_q, axis=1)
    for k in range(n_samples):
        if keep:
            predicted[k] = spread
        for i in range(n_outputs):
            row = cases.seen[k, :, None, i, :]
            toward = (spread @ row[..., None])[..., 0]
            variance[k, :, :, i] = np.sum(toward * row, axis=-1) + 1.0
            gain[k, :, :, i] = toward / variance[k, :, :, i, None]
            spread = spread - gain[k, :, :, i, :, None] * toward[..., None, :]
        if k < n_samples - 1:
            step = cases.transition[k][:, None]
            spread = step @ spread @ np.swapaxes(step, -1, -2) + walk
            if np.any(cases.jumps[k]):
                ways = cases.jump * cases.jumps[k][:, None, None]
                spread = spread + (ways @ np.swapaxes(ways, -1, -2))[:, None]
            if k % _EVENED == 0:
                spread = 0.5 * (spread + np.swapaxes(spread, -1, -2))
    return Gains(gain, variance, predicted)


def squares(cases: Cases, gains: Gains) -> Floats:
    """Return the sum of squares of the whitened prediction errors of the residual, shape (n_cases, n_intensities)."""
    n_samples, n_cases, n_outputs, n = cases.seen.shape
    with np.errstate(invalid="ignore"):
        root = np.sqrt(gains.variance)
    total = np.zeros(gains.variance.shape[1:3])
    state = np.zeros((n_cases, gains.variance.shape[2], n, 1))
    for k in range(n_samples):
        for i in range(n_outputs):
            row = cases.seen[k, :, None, i, None, :]
            error = cases.data[k, :, None, i, :1] - (row @ state)[..., 0, :]
            total += (error[..., 0] / root[k, :, :, i]) ** 2
            state = state + gains.gain[k, :, :, i, :, None] * error[..., None, :]
        if k < n_samples - 1:
            state = cases.transition[k][:, None] @ state + cases.drive[k, :, None, :, :1]
    return total


def smoothed(
    cases: Cases, gains: Gains, columns: slice, states: slice = slice(None)
) -> tuple[Floats, Floats]:
    """Smooth some columns of each case, for gains of a single intensity.

    Return some states estimated from a whole record as deviations from the reference, shape (n_samples, n_cases, n_states,
    n_columns), and the standard errors of all, shape (n_samples, n_cases, n_states), in units of the sizes.
    """
    drive, data = cases.drive[..., columns], cases.data[..., columns]
    n_samples, n_cases, n_outputs, n = cases.seen.shape
    n_columns = data.shape[3]
    deviation = np.zeros((n_samples, n_cases, np.arange(n)[states].size, n_columns))
    errors = np.zeros((n_samples, n_cases, n_outputs, n_columns))
    state = np.zeros((n_cases, n, n_columns))
    for k in range(n_samples):
        deviation[k] = state[:, states]
        for i in range(n_outputs):
            errors[k, :, i] = data[k, :, i] - np.sum(cases.seen[k, :, i, :, None] * state, axis=-2)
            state = state + gains.gain[k, :, 0, i, :, None] * errors[k, :, i, None, :]
        if k < n_samples - 1:
            state = cases.transition[k] @ state + drive[k]
    error = np.zeros((n_samples, n_cases, n))
    adjoint, spread = np.zeros((n_cases, n, n_columns)), np.zeros((n_cases, n, n))
    identity = np.eye(n)
    for k in range(n_samples - 1, -1, -1):
        if k < n_samples - 1:
            back = np.swapaxes(cases.transition[k], -1, -2)
            adjoint, spread = back @ adjoint, back @ spread @ cases.transition[k]
        for i in range(n_outputs - 1, -1, -1):
            row = cases.seen[k, :, i, :, None]
            kept = identity - gains.gain[k, :, 0, i, :, None] * np.swapaxes(row, -1, -2)
            back = np.swapaxes(kept, -1, -2)
            weight = 1.0 / gains.variance[k, :, 0, i]
            adjoint = back @ adjoint - row * (weight[:, None] * errors[k, :, i])[:, None, :]
            spread = back @ spread @ kept + row * np.swapaxes(row, -1, -2) * weight[:, None, None]
        known = gains.predicted[k, :, 0]
        deviation[k] -= (known @ adjoint)[:, states]
        error[k] = np.sqrt(np.maximum(np.einsum("cii->ci", known - known @ spread @ known), 0.0))
    return deviation, error
