"""Are the parameters of a fitted model physically plausible?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.policy import NOTES, VERDICT
from rigsight.diagnose.verdict.ranking import Ranking

_AT_BOUND = 1e-6
"""Distance from a bound of the search, relative to it, that counts as standing there."""


@dataclass(frozen=True)
class Doubt:
    """Why a parameter of a fitted model is implausible; `grave` if it counts against the model."""

    text: str
    grave: bool


def doubts(model: FittedModel, reidentified: FittedModel) -> tuple[Doubt, ...]:
    """Return the implausible parameters of a model."""
    fit = model.fit
    parameters = {p.name: p for p in fit.structure.parameters}
    own = {fit.structure.parameter_name(e, p.name) for e in model.effects for p in e.parameters}
    found = []
    if not fit.success:
        found.append(Doubt("Its fit did not converge.", True))
    unknown = [name for name in fit.free if name in own and not np.isfinite(fit.standard_errors[name])]
    if unknown:
        found.append(Doubt(f"The records do not determine {', '.join(unknown)}.", True))
    for name in fit.free:
        value, declared = fit.values[name], parameters[name]
        for bound in (declared.lower, declared.upper):
            zero = bound == 0.0 and value == 0.0
            if (
                bound is not None
                and np.isfinite(bound)
                and (zero or abs(value - bound) < _AT_BOUND * abs(bound))
            ):
                found.append(Doubt(f"{name} = {value:.3g} is at the bound of its search range.", False))
        before = reidentified.fit.values.get(name, 0.0)
        if name in fit.structure.rig.usually_positive and before > 0.0 and value > 0.0:
            ratio = value / before
            if not 1.0 / NOTES.far_off < ratio < NOTES.far_off:
                found.append(
                    Doubt(
                        f"{name} = {value:.3g} where the equations without the effect have {before:.3g}.",
                        False,
                    )
                )
        if name not in own and declared.lower == 0.0 and value < 0.0:
            found.append(Doubt(f"{name} = {value:.3g} is negative.", False))
    return tuple(found)


def plausible_first(ranking: Ranking, reidentified: FittedModel, places: Mapping[str, str]) -> Ranking:
    """Return the ranking with a plausible model before an implausible one that is hardly better and at the same place."""
    best = ranking.order[0]
    if not any(doubt.grave for doubt in doubts(best, reidentified)):
        return ranking
    at = {places[name] for name in best.names}
    for index, model in enumerate(ranking.order[1:], start=1):
        as_good = (
            bool(model.residuals) and model.error_over_noise <= VERDICT.comparable * best.error_over_noise
        )
        same_place = {places[name] for name in model.names} <= at
        if as_good and same_place and not any(doubt.grave for doubt in doubts(model, reidentified)):
            return _with_first(ranking, index)
    return ranking


def _with_first(ranking: Ranking, index: int) -> Ranking:
    """Return the ranking with one model moved to its front, together with the probability of the one that stood there."""
    shares = list(ranking.probabilities)
    shares[0], shares[index] = shares[index], shares[0]
    chosen = ranking.order[index]
    rivals: Sequence[FittedModel] = [m for m in ranking.tied if m is not chosen]
    grounds = [replace(own, share=share) for own, share in zip(ranking.grounds, shares, strict=True)]
    first = [index, *(i for i in range(len(shares)) if i != index)]
    return replace(
        ranking,
        order=tuple(ranking.order[i] for i in first),
        probabilities=tuple(shares[i] for i in first),
        grounds=tuple(grounds[i] for i in first),
        tied=(ranking.order[0], *rivals),
        error_of_choice=math.nan,
    )
