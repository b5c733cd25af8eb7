"""What a search for a second effect works with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigsight.diagnose.fitting.fit_context import FitContext, Scored
from rigsight.diagnose.fitting.preparation import Prepare
from rigsight.diagnose.search.several.evidence_for_more import OtherForms
from rigsight.diagnose.search.several.one_more_effect import with_one_more
from rigsight.effects import Effect


@dataclass(frozen=True)
class PairSearch:
    """Records, candidates and limits of a search for a second effect.

    Attributes
    ----------
    context
        Records, scales and noise.
    singles
        Every effect alone, fitted and scored.
    usable
        Those of them that could be simulated, best first.
    effects
        Candidates for the second place.
    at_floor
        Held-out error, in units of the noise floor, at which nothing is left to explain.
    allowed
        Held-out error that a pair may leave to compete.
    forms
        Says which effects are worth trying beside another.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """

    context: FitContext
    singles: Sequence[Scored]
    usable: Sequence[Scored]
    effects: Sequence[Effect]
    at_floor: float
    allowed: float
    forms: OtherForms
    prepare: Prepare | None

    def beside(
        self,
        single: Scored,
        effects: Sequence[Effect],
        known: Sequence[Scored],
        enough: float = float("inf"),
    ) -> list[Scored]:
        """Return new pairs of a single effect with others, see `with_one_more`.

        Parameters
        ----------
        single
            The effect that is kept.
        effects
            Candidates beside it.
        known
            Pairs that need not be tried again.
        enough
            Error, in units of the noise floor, above which effects that the screening puts last are tried, too.
        """
        return with_one_more(self.context, single, effects, known, self.usable, self.prepare, enough=enough)
