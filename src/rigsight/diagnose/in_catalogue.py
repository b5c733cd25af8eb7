"""How probable is it that the cause is among the candidates at all?

The held-out errors of candidates tell which of them is best, not whether a cause that nobody thought of would do better. How near
a mere relative of the cause comes by chance can be said: it closes some share of the gap, and of a faint gap what it leaves hides
below the uncertainty of the noise floor.
"""

from __future__ import annotations

import math

from rigsight.diagnose.candidates.one_law import is_one_law
from rigsight.diagnose.rank import Ranking
from rigsight.diagnose.verdict import AT_FLOOR, Judgement, most_left

_ONE_LAW = 0.5
"""Most that is given to two effects that are one law together: another form of that law would look the same."""
_ABOVE_THE_BOUND = 0.5
"""Most that is given to a cause that leaves more of a lower bound of the floor than a cause may leave of a measured one.

An assumption: that the rest is noise and that the form is wrong are taken to be as likely.
"""
_MOST = 0.99
_ODDS_OUTSIDE_ONE = 0.25
"""Odds of a cause outside the catalogue against one effect of it, before any record is seen; an assumption."""
_ODDS_OUTSIDE_TWO = 1.0
"""The same against two effects together; an assumption."""
_TRIES = 3
"""Unlike partners that had a chance each to fill by accident what the first effect leaves; an assumption, no count."""
_AT_MOST_UNKNOWN = 0.3
"""Most that is given to all candidates together where the best leaves more than a cause may."""


def probability_in_catalogue(judgement: Judgement, ranking: Ranking, gap: float) -> float:
    """Return the probability that the cause is among the candidates, from what the chosen one leaves of what it was to explain.

    A relative of the true cause is taken to leave any share of the gap's amplitude as likely as any other. So did the best
    single effects on rigs with a cause from outside the catalogue (19 blind trials, `experiments/blind_small`). A second effect
    is to explain what the best single one leaves, which is often faint.

    Parameters
    ----------
    judgement
        The verdict and the model that stands for it.
    ranking
        All candidates.
    gap
        What the rig's own equations leave, re-identified, in units of the noise floor.
    """
    if judgement.verdict in ("none", "parameters"):
        return 0.0  # the equations without an effect explain the records
    if not ranking.order or not math.isfinite(ranking.order[0].excess):
        return 0.0
    above = max(ranking.order[0].excess - AT_FLOOR, 0.0)
    if judgement.verdict == "unknown":
        return _AT_MOST_UNKNOWN / (1.0 + above)
    model = judgement.model
    chance = _chance_of_a_relative(model.excess, gap)
    odds = _ODDS_OUTSIDE_ONE
    if len(model.effects) > 1:
        single = min((m.excess for m in ranking.order if len(m.effects) == 1), default=gap)
        chance = 1.0 - (1.0 - _chance_of_a_relative(model.excess, single)) ** _TRIES
        odds = _ODDS_OUTSIDE_TWO
    # Above the floor something is left that is not the cause's, if its form is right at all: one half far above.
    form = 0.5 + (_MOST - 0.5) / (1.0 + above)
    share = form / (1.0 + odds * chance)
    if is_one_law(model):
        share = min(share, _ONE_LAW)
    return min(share, _ABOVE_THE_BOUND) if model.excess > most_left(gap) else share


def _chance_of_a_relative(left: float, gap: float) -> float:
    """Return the probability that a relative of the cause leaves no more of a gap than this, both in units of the noise floor."""
    if gap <= AT_FLOOR:
        return 1.0
    return min(1.0, math.sqrt((max(left, AT_FLOOR) ** 2 - 1.0) / (gap**2 - 1.0)))
