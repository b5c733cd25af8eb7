"""How probable is it that the cause is among the candidates at all?

The held-out errors of candidates tell which of them is best, not whether a cause that nobody thought of would do better. How near
a mere relative of the cause comes by chance can be said: it closes some share of the gap, and of a faint gap what it leaves hides
below the uncertainty of the noise floor.
"""

from __future__ import annotations

import math

from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.one_law import is_one_law
from rigsight.diagnose.verdict.judgement import Judgement, most_left
from rigsight.diagnose.verdict.ranking import Ranking

_ONE_LAW = 0.5
"""Most that is given to two effects that are one law together: another form of that law would look the same."""
_WITH_A_REMAINDER = 0.5
"""Most that is given to a cause that leaves more than a cause may, and what it leaves is no noise; also above a lower bound.

An assumption: that something smaller is missing too and that a relative stands for the cause are taken to be as likely.
"""
_MOST = 0.99
_ODDS_OUTSIDE_ONE = 0.25
"""Odds of a cause outside the catalogue against one effect of it, before any record is seen; an assumption."""
_ODDS_OUTSIDE_SEVERAL = 1.0
"""The same against two or three effects together; an assumption."""
_TRIES = 3
"""Unlike partners that had a chance each to fill by accident what is left without it; an assumption, no count."""
_AT_MOST_UNKNOWN = 0.3
"""Given to all candidates together where none takes the larger part of the gap or they contradict each other; an assumption."""


def probability_in_catalogue(
    judgement: Judgement, ranking: Ranking, gap: float, adequate: bool = False
) -> float:
    """Return the probability that the cause is among the candidates, from what the chosen one leaves of what it was to explain.

    A relative of the true cause is taken to leave any share of the gap's amplitude as likely as any other. So did the best
    single effects on rigs with a cause from outside the catalogue (19 blind trials, `experiments/blind_small`). A second or
    third effect is to explain what the best model without it leaves, which is often faint.

    Parameters
    ----------
    judgement
        The verdict and the model that stands for it.
    ranking
        All candidates.
    gap
        What the rig's own equations leave, re-identified, in units of the noise floor.
    adequate
        True where what the model of the verdict leaves counts as noise and disturbance, whatever the floor says.
    """
    if judgement.verdict in ("none", "parameters"):
        return 0.0  # the equations without an effect explain the records
    if not ranking.order or not math.isfinite(ranking.order[0].error_over_noise):
        return 0.0
    if judgement.verdict == "unknown":
        return _AT_MOST_UNKNOWN
    model = judgement.model
    # What is left of an adequate model is the noise, and everything is measured in units of it.
    floor = max(model.error_over_noise, 1.0) if adequate else 1.0
    gap /= floor
    left = model.error_over_noise / floor
    above = max(left - VERDICT.at_floor, 0.0)
    chance = _chance_of_a_relative(left, gap)
    odds = _ODDS_OUTSIDE_ONE
    if len(model.effects) > 1:
        fewer = [
            m.error_over_noise / floor for m in ranking.order if len(m.effects) == len(model.effects) - 1
        ]
        chance = 1.0 - (1.0 - _chance_of_a_relative(left, min(fewer, default=gap))) ** _TRIES
        odds = _ODDS_OUTSIDE_SEVERAL
    # Above the floor something is left that is not the cause's, if its form is right at all: one half far above.
    form = 0.5 + (_MOST - 0.5) / (1.0 + above)
    share = form / (1.0 + odds * chance)
    if is_one_law(model):
        share = min(share, _ONE_LAW)
    return min(share, _WITH_A_REMAINDER) if left > most_left(gap) else share


def _chance_of_a_relative(left: float, gap: float) -> float:
    """Return the probability that a relative of the cause leaves no more of a gap than this, both in units of the noise floor."""
    if gap <= VERDICT.at_floor:
        return 1.0
    return min(1.0, math.sqrt((max(left, VERDICT.at_floor) ** 2 - 1.0) / (gap**2 - 1.0)))
