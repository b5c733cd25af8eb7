"""Can a fitted model be the cause? Each effect has a size, the records determine it, and are as long as it is slow or long.

What cannot be the cause does not lead the ranking, however little it leaves. A resonance slower than the records follows each of
them by its free initial states: it does not lead the search, either. Standard errors count in the ranking only: not all fits of
the search are finished.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2, norm

from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import VERDICT
from rigsight.diagnose.search.nested_models import is_lower
from rigsight.effects import Effect, placed_dimension
from rigsight.frequency.persistent_line import line_power
from rigsight.identify.fit.windows import leading_output
from rigsight.parameters import Parameter
from rigsight.records import Record
from rigsight.records.signals import is_constant
from rigsight.rigs import Rig
from rigsight.units import characteristic_value


def can_be_cause(
    context: FitContext, model: FittedModel, reidentified: FittedModel, models: Sequence[FittedModel]
) -> bool:
    """Return True for a model whose effects the records show, compared with the equations and the other models."""
    return (
        not has_size_of_zero(model, [reidentified, *models])
        and not is_undetermined(model, reidentified)
        and not is_beyond_records(model, context)
    )


def leading(context: FitContext, singles: Sequence[FittedModel]) -> FittedModel | None:
    """Return the best single effect that is not slower or longer than the records; where all are, the best of them."""
    usable = [model for model in singles if model.residuals and np.isfinite(model.error_over_noise)]
    within = [model for model in usable if not is_beyond_records(model, context)]
    return min(within or usable, key=lambda model: model.error_over_noise, default=None)


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


def is_beyond_records(model: FittedModel, context: FitContext) -> bool:
    """Return True if an effect is slower, longer or coarser than the records can show: it is another spring."""
    # Its wave is longer than the travel of the motion, its time constant or period longer than every record [s], or the length
    # over which it yields beyond its search; or the periods of a tone are too few in each record. A delay must leave the larger
    # part of a record: before, the reading is what it was at the start, whatever the input.
    fit, scales = model.fit, context.scales
    duration = max(record.duration for record in context.records)

    def is_delay(effect: Effect, parameter: Parameter) -> bool:
        late = (effect.delay, effect.reading_delay, effect.command_delay)
        return any(own is not None and parameter.name in map(str, own.free_symbols) for own in late)

    def is_too_long(effect: Effect, parameter: Parameter) -> bool:
        value = fit.values[fit.structure.parameter_name(effect, parameter.name)]
        if is_delay(effect, parameter):
            return abs(value) > (1.0 - VERDICT.larger_part) * duration
        if parameter.dimension == "time":
            return value > duration
        if parameter.dimension == "time^-1":
            is_tone = parameter.name == str(effect.pulsation)
            least = VERDICT.least_periods if is_tone else 1.0
            of_rig = is_tone and all(_swings_freely_at(value, context.rig, own) for own in context.records)
            return of_rig or value * duration < 2.0 * math.pi * least
        if parameter.name == effect.wave_number:
            return value * characteristic_value(placed_dimension(effect, "travel"), scales) < 2.0 * math.pi
        size = characteristic_value(placed_dimension(effect, parameter.dimension), scales)
        return parameter.dimension == "x" and value > parameter.search[1] * size

    return any(
        is_too_long(effect, parameter)
        for effect in model.effects
        for parameter in effect.parameters
        if (parameter.null is None or is_delay(effect, parameter))
        and fit.structure.parameter_name(effect, parameter.name) in fit.free
    )


def _swings_freely_at(pulsation: float, rig: Rig, record: Record) -> bool:
    """Return True if a motion that nothing drives decays at a frequency that is not resolved from this one (half power)."""
    output = leading_output(rig, [record])
    if any(not is_constant(record[s.name]) for s in rig.inputs if s.name in record) or output not in record:
        return False
    motion, half = record[output] - np.mean(record[output]), record.n_samples // 2
    spectrum = np.abs(np.fft.rfft(motion, 4 * motion.size)) ** 2
    own = 2.0 * math.pi * np.argmax(spectrum) / (4 * motion.size * record.dt)
    decays = np.sum(motion[half:] ** 2) < (1.0 - VERDICT.larger_part) * np.sum(motion[:half] ** 2)
    power = [line_power(motion, record.dt, w) for w in (pulsation, own)]
    return bool(decays and power[0] > VERDICT.larger_part * power[1])


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
