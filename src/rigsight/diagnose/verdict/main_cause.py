"""Main cause: does one model explain more than half of the gap, and do others at other places explain the same part?

If they do, such as a delayed drive and a delayed sensor, only the place of the cause is open. What it leaves is the remainder:
on a measured rig no law is exact, so a remainder does not refute a cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import FittedModel
from rigsight.diagnose.noise.block_means import squared_errors
from rigsight.diagnose.policy import VERDICT
from rigsight.inverse import MissingForce
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


def traced_to(rig: Rig, forces: Sequence[MissingForce]) -> tuple[str, ...]:
    """Return the only joint at which a missing force explains the larger part, with the drives that act along its motion.

    Empty where no joint does, or several of them leave about as much.
    """
    least = min((1.0 - force.share for force in forces), default=1.0)
    agreeing = [force for force in forces if 1.0 - force.share <= VERDICT.comparable**2 * least]
    if len(forces) < 2 or len(agreeing) != 1 or agreeing[0].share < VERDICT.larger_part:
        return ()
    joint = next(joint for joint in rig.mechanism.joints if joint.name == agreeing[0].where)
    return (joint.name, *(drive.name for drive in rig.mechanism.drives if drive.along == joint.motion))
