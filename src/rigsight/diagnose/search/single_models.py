"""Models with at most one effect, and what is known before others are fitted."""

from __future__ import annotations

from dataclasses import dataclass

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.search.places import Search
from rigsight.diagnose.search.worth_fitting import WorthFitting
from rigsight.effects import Effect, Family
from rigsight.identify.fit.windows import Windowing
from rigsight.inverse import Proposal


@dataclass(frozen=True)
class SingleModels:
    """Models with at most one effect, fitted and scored on the same records."""

    windowing: Windowing  # how records were cut
    context: FitContext  # records, scales and noise
    # The given simulation, and its equations with refitted parameters.
    before: FittedModel
    reidentified: FittedModel
    singles: list[FittedModel]  # every effect by itself
    search: Search  # where and for which effects was searched
    # What the motion says of the missing force before any fit; None where the sensors do not show the motion.
    proposal: Proposal | None
    effects: tuple[Effect, ...]  # all candidates
    worth: WorthFitting  # those that may be the main cause
    # All causes that the motion names, fitted together; None where it does not show the force or names fewer than two.
    together: FittedModel | None

    @property
    def named(self) -> frozenset[tuple[Family, str]]:
        """Families at their places that the motion names, where it shows the force."""
        if not self.worth.is_shown or self.proposal is None:
            return frozenset()
        return frozenset((cause.family, cause.where) for cause in self.proposal.taken)
