"""What a search for a second effect works with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigsight.diagnose.fitting.fit_context import FitContext, FittedModel
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.one_more_effect import with_one_more
from rigsight.effects import Effect


@dataclass(frozen=True)
class PairSearch:
    """Records, candidates and limits of a search for a second effect."""

    context: FitContext  # records, scales and noise
    singles: Sequence[FittedModel]  # every effect alone, fitted and scored
    usable: Sequence[FittedModel]  # those of them that could be simulated, best first
    effects: Sequence[Effect]  # candidates for the second place
    at_floor: float  # held-out error, in units of the noise floor, at which nothing is left to explain
    allowed: float  # held-out error that a pair may leave to compete
    forms: OtherForms  # says which effects are worth trying beside another
    # Called with the structures that are about to be looked at, to compile them side by side.
    prepare: Prepare | None

    def beside(
        self,
        single: FittedModel,
        effects: Sequence[Effect],
        known: Sequence[FittedModel],
        enough: float = float("inf"),
    ) -> list[FittedModel]:
        """Return new pairs of a single effect with others, see `with_one_more`."""
        return with_one_more(self.context, single, effects, known, self.usable, self.prepare, enough=enough)
