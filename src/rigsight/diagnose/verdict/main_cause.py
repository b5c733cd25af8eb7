"""Main cause: does one model explain more than half of the gap, and do others at other places explain the same part?

If they do, such as a delayed drive and a delayed sensor, only the place of the cause is open. What it leaves is the remainder:
on a measured rig no law is exact, so a remainder does not refute a cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel, liveliest
from rigsight.diagnose.noise.block_means import squared_errors
from rigsight.diagnose.policy import SEARCH, VERDICT
from rigsight.discover import JointForce, MissingForce, missing_force, missing_forces, not_contradicted
from rigsight.errors import InputError, SimulationError
from rigsight.identify import without_offsets
from rigsight.rigs import Rig


@dataclass(frozen=True)
class MainCause:
    """The share of the re-identified gap that a model explains."""

    share: float  # of the squared gap above the noise floor
    at_least: float  # lower limit of the share in 95 % of the resamplings of the records' stretches
    # Equally good models that act at other places and explain another part of the gap.
    contradicted_by: tuple[FittedModel, ...] = ()
    # Equally good models that act at other places but explain the same part.
    equalled_by: tuple[FittedModel, ...] = ()

    @property
    def clear(self) -> bool:
        """True if the model explains more than half."""
        return self.share > VERDICT.larger_part


def main_cause(
    rig: Rig,
    reidentified: FittedModel,
    best: FittedModel,
    tied: Sequence[FittedModel],
    noise: NDArray[np.float64],
    rng: np.random.Generator,
) -> MainCause:
    """Determine the share of the residual of the equations that a model explains."""
    squares = squared_errors([model.residuals for model in (reidentified, best)], noise)
    gap, remainder = squares.resampled(squares.draws(rng)).T
    share = _share(*squares.mean)
    lowest = float(np.quantile([_share(g, r) for g, r in zip(gap, remainder, strict=True)], VERDICT.surely))
    places = {rig.acts_at(effect) for effect in best.effects}
    elsewhere = [m for m in tied if places.isdisjoint(rig.acts_at(effect) for effect in m.effects)]
    same = [m for m in elsewhere if _common_part(reidentified, best, m, noise) > VERDICT.larger_part]
    other = [m for m in elsewhere if m not in same]
    return MainCause(share, lowest, tuple(other), tuple(same))


def _common_part(
    reidentified: FittedModel, one: FittedModel, other: FittedModel, noise: NDArray[np.float64]
) -> float:
    """Return the share of the squared gap explained by one model that another explains too."""
    explained = differing = 0.0
    for gap, remainder, others_left in zip(
        reidentified.residuals, one.residuals, other.residuals, strict=True
    ):
        explained += float(np.nansum(((gap - remainder) / noise) ** 2))
        differing += float(np.nansum(((others_left - remainder) / noise) ** 2))
    return 1.0 - differing / explained if explained > 0.0 else 0.0


def _share(gap: float, remainder: float) -> float:
    return float((gap - remainder) / (gap - 1.0)) if gap > 1.0 else 0.0


def force_of_one_motion(
    context: FitContext, reidentified: FittedModel, has_stiffness: bool, rng: np.random.Generator
) -> MissingForce | None:
    """Return the shape of the force missing on a rig with one motion; None for any other rig.

    There is none beside effects that are modelled already either: the rig's own terms do not stand alone there. Nor is there
    one from records that are too short for a regression, or whose own constants change inertia, spring or damper.
    """
    if context.modelled or not context.rig.has_one_motion:
        return None
    noise = context.noise[context.rig.outputs[0].name]
    centered = without_offsets(context.estimation, reidentified.fit)
    values = reidentified.fit.values
    try:
        return missing_force(context.rig, centered, values, context.scales, noise, rng, has_stiffness)
    except InputError:
        return None


def forces_at_joints(context: FitContext, reidentified: FittedModel) -> tuple[JointForce, ...]:
    """Return the force that would have to be missing at each joint, the most likely first; none for a rig with one motion.

    There are none beside effects that are modelled already either.
    """
    if context.modelled or context.rig.has_one_motion:
        return ()
    centered = without_offsets(context.estimation, reidentified.fit)
    try:
        return missing_forces(
            context.rig,
            liveliest(centered, context.rig, SEARCH.traced_samples),
            reidentified.fit.values,
            context.noise,
        )
    except (SimulationError, np.linalg.LinAlgError):
        # A diagnosis is still useful if the missing force cannot be found.
        return ()


def traced_to(rig: Rig, forces: Sequence[JointForce]) -> tuple[str, ...]:
    """Return the places of the only missing force that agrees with all sensors; empty if none or several agree.

    These are a joint, and the drives that act along the same motion.
    """
    agreeing = not_contradicted(forces)
    if len(forces) < 2 or len(agreeing) != 1 or agreeing[0].error_over_noise > VERDICT.comparable:
        return ()
    joint = next(joint for joint in rig.mechanism.joints if joint.name == agreeing[0].joint)
    return (joint.name, *(drive.name for drive in rig.mechanism.drives if drive.along == joint.motion))
