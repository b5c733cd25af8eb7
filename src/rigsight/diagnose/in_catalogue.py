"""How probable is it that the cause is among the candidates at all?

The held-out errors of candidates tell which of them is best, not whether a cause that nobody thought of would do better. How near
a mere relative of the cause comes by chance can be said: it closes some share of the gap, and of a faint gap what it leaves hides
below the uncertainty of the noise floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import sympy as sp

from rigsight.diagnose.rank import Ranking
from rigsight.diagnose.verdict import AT_FLOOR, Judgement
from rigsight.diagnose.workbench import Scored
from rigsight.effects import Effect, Place
from rigsight.effects import symbols as canonical

_ONE_LAW = 0.5
"""Most that is given to two effects that are one law together: another form of that law would look the same."""
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
    one_law = _one_force(model.effects) or _one_linear_system(model)
    return min(share, _ONE_LAW) if one_law else share


def _chance_of_a_relative(left: float, gap: float) -> float:
    """Return the probability that a relative of the cause leaves no more of a gap than this, both in units of the noise floor."""
    if gap <= AT_FLOOR:
        return 1.0
    return min(1.0, math.sqrt((max(left, AT_FLOOR) ** 2 - 1.0) / (gap**2 - 1.0)))


def _one_force(effects: Sequence[Effect]) -> bool:
    """Return True for two effects of the spring or two forces without memory of the same signals: their sum is one more such."""
    if len(effects) < 2:
        return False
    if all(_is_of_the_spring(effect) for effect in effects):
        return True
    return all(effect.torque is not None and not effect.states for effect in effects) and all(
        _read(effect) == _read(effects[0]) for effect in effects
    )


def _one_linear_system(model: Scored) -> bool:
    """Return True for two linear effects between the same signals: many another linear system has their frequency response."""
    if len(model.effects) < 2:
        return False
    one_output = len(model.fit.structure.rig.outputs) == 1
    return all(
        is_linear(effect) and effect.lateral is None and (one_output or effect.place is not Place.SENSOR)
        for effect in model.effects
    )


def is_linear(effect: Effect) -> bool:
    """Return True if an effect leaves a linear rig linear.

    Parameters
    ----------
    effect
        Of the catalogue or from elsewhere.
    """
    signals = [canonical.x, canonical.v, canonical.u, canonical.reading, canonical.spring_torque]
    signals += [
        canonical.creepage,
        canonical.lateral_displacement,
        canonical.deflection,
        canonical.deflection_rate,
    ]
    signals += [state.symbol for state in effect.states]
    laws = [effect.torque, effect.spring, effect.deflection, effect.drive, effect.lateral, effect.measured]
    laws += [state.rate for state in effect.states]
    return all(_is_linear_in(law, signals) for law in laws if law is not None) and all(
        state.limit is None for state in effect.states
    )


def _is_linear_in(law: sp.Expr, signals: Sequence[sp.Symbol]) -> bool:
    own = [symbol for symbol in signals if symbol in law.free_symbols]
    slopes = [sp.diff(law, symbol) for symbol in own]
    return not any(slope.free_symbols & {*own, canonical.t} for slope in slopes)


def _is_of_the_spring(effect: Effect) -> bool:
    of_displacement = effect.torque is not None and not effect.states and _read(effect) == {canonical.x.name}
    return effect.spring is not None or effect.deflection is not None or of_displacement


def _read(effect: Effect) -> set[str]:
    """Return the names of the signals that a force depends on."""
    assert effect.torque is not None
    return {symbol.name for symbol in effect.torque.free_symbols} - {p.name for p in effect.parameters}
