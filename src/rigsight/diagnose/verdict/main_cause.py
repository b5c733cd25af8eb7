"""Main cause: does one model certainly explain more than half of the gap, and no equally good model another part?

Models at different places contradict each other if they explain different parts of the gap. If they explain the same part, such
as a delayed drive and a delayed sensor, only the place of the cause is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.fitting.fit_context import Scored
from rigsight.diagnose.noise.block_means import squared_errors
from rigsight.diagnose.policy import VERDICT
from rigsight.rigs import Rig


@dataclass(frozen=True)
class MainCause:
    """The share of the re-identified gap that a model explains."""

    share: float  # of the squared gap above the noise floor
    at_least: float  # lower limit of the share in 95 % of the resamplings of the records' stretches
    # Equally good models that act at other places and explain another part of the gap.
    contradicted_by: tuple[Scored, ...] = ()
    # Equally good models that act at other places but explain the same part.
    equalled_by: tuple[Scored, ...] = ()

    @property
    def clear(self) -> bool:
        """True if the model certainly explains more than half and no equally good model contradicts it."""
        return self.at_least > VERDICT.larger_part and not self.contradicted_by


def main_cause(
    rig: Rig,
    reidentified: Scored,
    best: Scored,
    tied: Sequence[Scored],
    noise: NDArray[np.float64],
    rng: np.random.Generator,
) -> MainCause:
    """Determine the share of the residual of the equations that a model explains."""
    squares = squared_errors([model.residuals for model in (reidentified, best)], noise)
    gap, left = squares.resampled(squares.draws(rng)).T
    share = _share(*squares.mean)
    lowest = float(np.quantile([_share(g, r) for g, r in zip(gap, left, strict=True)], VERDICT.surely))
    places = {rig.acts_at(effect) for effect in best.effects}
    elsewhere = [m for m in tied if places.isdisjoint(rig.acts_at(effect) for effect in m.effects)]
    same = [m for m in elsewhere if _common_part(reidentified, best, m, noise) > VERDICT.larger_part]
    other = [m for m in elsewhere if m not in same]
    return MainCause(share, lowest, tuple(other), tuple(same))


def _common_part(reidentified: Scored, one: Scored, other: Scored, noise: NDArray[np.float64]) -> float:
    """Return the share of the squared gap explained by one model that another explains too."""
    explained = differing = 0.0
    for gap, left, others_left in zip(reidentified.residuals, one.residuals, other.residuals, strict=True):
        explained += float(np.nansum(((gap - left) / noise) ** 2))
        differing += float(np.nansum(((others_left - left) / noise) ** 2))
    return 1.0 - differing / explained if explained > 0.0 else 0.0


def _share(gap: float, left: float) -> float:
    return float((gap - left) / (gap - 1.0)) if gap > 1.0 else 0.0
