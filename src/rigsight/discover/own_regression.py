"""Regression on the rig's own terms, to which every further term is added."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rigsight.discover.motion import Motion
from rigsight.discover.regression import Projected
from rigsight.discover.weak_form import Rows
from rigsight.errors import InputError
from rigsight.records.plausibility import is_constant
from rigsight.rigs import Rig

_WINDOW = 0.75
"""Width of a test function in natural periods: long enough to average the noise, short enough to resolve the motion."""
_MOST_POINTS = 20_000


def rows_of(motions: Sequence[Motion], time: float, pointwise: bool = False) -> Rows:
    """Return the form of the rows: windows for a rig whose angular frequency is ``1 / time``, or single points."""
    if pointwise:
        return Rows.pointwise(max(1, sum(motion.x.size for motion in motions) // _MOST_POINTS))
    return Rows.weak(_WINDOW * 2.0 * np.pi * time)


def own_regression(rig: Rig, has_stiffness: bool, motions: Sequence[Motion], rows: Rows) -> Projected:
    """Return the regression of acceleration (or force, if the motion is prescribed) on the rig's own terms."""
    order = 2 if rig.is_driven else 0
    rests = all(is_constant(motion.u) for motion in motions)
    blocks, targets = [], []
    for motion in motions:
        velocity, displacement = rows.velocity(motion), rows.of(motion.x, motion.dt)
        one = np.ones_like(displacement)
        if not rig.is_driven:
            blocks.append(np.column_stack([velocity, displacement, one]))
            targets.append(rows.of(motion.measured, motion.dt))
            continue
        # A constant drive is part of the constant term; its column is kept as zeros, so that the others keep their positions.
        drive = np.zeros_like(one) if rests else rows.of(motion.u, motion.dt)
        own = (drive, -velocity, -displacement, one) if has_stiffness else (drive, -velocity, one)
        blocks.append(np.column_stack(own))
        targets.append(rows.acceleration(motion))
    independent = sum(
        target.size * rows.independent_share(order, motion.dt)
        for target, motion in zip(targets, motions, strict=True)
    )
    base = np.concatenate(blocks)
    if base.shape[0] <= base.shape[1]:
        longest = max(motion.x.size * motion.dt for motion in motions)
        raise InputError(
            f"The records are too short for a regression: the longest has {longest:.3g} s, and the equations are integrated over "
            f"windows of {rows.width:.3g} s. Add a longer record."
        )
    return Projected(base, np.concatenate(targets), max(independent, 10.0))


def own_terms(rig: Rig, has_stiffness: bool, projected: Projected) -> dict[str, NDArray[np.float64]]:
    """Return the columns of the rig's damper and spring, which compete in the full form."""
    motion = rig.motion
    first = 1 if rig.is_driven else 0
    own = {motion.damping.name: projected.base[:, first]}
    if has_stiffness:
        own[motion.stiffness.name] = projected.base[:, first + 1]
    return own
