"""Are the parameters of a fitted model physically possible, and do the records determine them?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, norm

from rigsight.diagnose.fit_context import FittedModel
from rigsight.diagnose.policy import NOTES, VERDICT
from rigsight.diagnose.search.nested_models import is_lower
from rigsight.diagnose.verdict.ranking import Ranking
from rigsight.effects import Effect, placed_dimension
from rigsight.parameters import Parameter
from rigsight.units import characteristic_value

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


def is_undetermined(model: FittedModel, reidentified: FittedModel) -> bool:
    """Return True if the records determine no parameter of an effect of a model, but those of the equations without it."""
    # An effect that opens a common factor of all numbers is no cause: a drive always at its limit is one of a smaller gain. Where
    # that factor is open without it, the effect is determined relative to it.
    fit, without = model.fit, reidentified.fit
    of_effects = [[fit.structure.parameter_name(e, p.name) for p in e.parameters] for e in model.effects]
    errors = [[fit.standard_errors[name] for name in names if name in fit.free] for names in of_effects]
    unknown = any(own and not np.any(np.isfinite(own)) for own in errors)
    return unknown and bool(np.all(np.isfinite([without.standard_errors[name] for name in without.free])))


def has_size_of_zero(model: FittedModel, others: Sequence[FittedModel]) -> bool:
    """Return True if the size of one of the effects of a model does not differ from zero: it cannot be named."""
    # It does not if removing the effect does not raise chi square, or if its parameters with a null value are within their errors
    # of that, tested together by Wald's chi square. Where these are determined only with others, the former decides alone; so it
    # does for an effect without a state of its own that removes the larger part of the squared error of records that it was not
    # fitted to (a hidden state could do so from a free start).
    models = {frozenset(other.names): other for other in others}

    def is_zero(effect: Effect) -> bool:
        without = models.get(frozenset(model.names) - {effect.name})
        if without is not None and not is_lower(model.fit, without.fit):
            return True
        if without is None or effect.states:
            return _is_within_errors(model, effect)
        smaller_part = (1.0 - VERDICT.larger_part) * without.error_over_noise**2
        return model.error_over_noise**2 > smaller_part and _is_within_errors(model, effect)

    return any(map(is_zero, model.effects))


def stands(model: FittedModel, reidentified: FittedModel, models: Sequence[FittedModel]) -> bool:
    """Return True for a model whose effects have a size, compared with the equations and the other models."""
    return not has_size_of_zero(model, [reidentified, *models])


def is_beyond_records(model: FittedModel, scales: Mapping[str, float], duration: float) -> bool:
    """Return True if an effect is slower, longer or coarser than the records can show: it is another spring."""
    # Its wave is longer than the motion, its time constant or period longer than every record [s], or the length over which it
    # yields beyond its search; or the periods of a tone are too few in each record.
    fit = model.fit

    def is_too_long(effect: Effect, parameter: Parameter) -> bool:
        value = fit.values[fit.structure.parameter_name(effect, parameter.name)]
        if parameter.dimension == "time":
            return value > duration
        if parameter.dimension == "time^-1":
            least = VERDICT.least_periods if parameter.name == str(effect.pulsation) else 1.0
            return value * duration < 2.0 * math.pi * least
        size = characteristic_value(placed_dimension(effect, parameter.dimension), scales)
        if parameter.name == effect.wave_number:
            return value < parameter.search[0] * size
        return parameter.dimension == "x" and value > parameter.search[1] * size

    return any(
        is_too_long(effect, parameter)
        for effect in model.effects
        for parameter in effect.parameters
        if parameter.null is None and fit.structure.parameter_name(effect, parameter.name) in fit.free
    )


def _is_within_errors(model: FittedModel, effect: Effect) -> bool:
    """Return True if the size of an effect is determined and does not differ from zero, an infinite one in the reciprocal."""
    fit = model.fit
    sizes = {
        name: fit.values[name] - (0.0 if p.is_limit else p.null)
        for p in effect.parameters
        if p.null is not None and (name := fit.structure.parameter_name(effect, p.name)) in fit.free
    }
    if not sizes or not all(0.0 < fit.standard_errors[name] < math.inf for name in sizes):
        return False
    at = [fit.free.index(name) for name in sizes]
    distance = np.array(list(sizes.values()))
    square = distance @ np.linalg.pinv(fit.covariance[np.ix_(at, at)], hermitian=True) @ distance
    return bool(chi2.sf(square, len(sizes)) > 2.0 * norm.sf(VERDICT.standard_errors))


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
