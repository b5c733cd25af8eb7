"""Are the parameters of the diagnosed model the same in every record, at every amplitude and in shorter windows? If not, why?

Nothing is refitted: estimates by group follow from one Gauss-Newton step from the common fit.

References
----------
W. G. Cochran, J. R. Stat. Soc. Suppl. 4 (1937) 102, for the test of homogeneity by weighted squares. B. L. Welch, Biometrika 38
(1951) 330, for the same where the variances are estimated, each with its degrees of freedom. S. Holm, Scand. J. Stat. 6 (1979)
65, for several tests. R. E. Barlow, D. J. Bartholomew, J. M. Bremner and H. D. Brunk, *Statistical Inference under Order
Restrictions* (Wiley 1972), for the best monotonic trend.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import isotonic_regression
from scipy.stats import chi2, norm
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from rigsight.compare import OwnNumber, own_numbers
from rigsight.diagnose.fit_context import FitContext, FittedModel
from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.estimates import PORTION, RECORD, WINDOW_LENGTH, View, views
from rigsight.diagnose.trust.patterns import Order, Pattern, Role, meaning, orders, roles
from rigsight.diagnose.trust.pieces import pieces
from rigsight.diagnose.trust.statement import (
    CorrelatedParameters,
    GroupValue,
    ParameterTrust,
    Trust,
    percent,
    statement,
)
from rigsight.identify import FitResult
from rigsight.identify.information import POORLY_KNOWN
from rigsight.records import Hold
from rigsight.records.record import Floats, Record
from rigsight.simulate.model import Model

_NOT_SIMULATED = "Whether the parameters hold in each record could not be tested: the model cannot be simulated in one of them."
_NOTHING_FITTED = "No parameter was fitted, so none can differ from record to record."


@dataclass(frozen=True)
class _Way:
    """How a number differs, in which direction, and with what it goes."""

    pattern: Pattern
    direction: int = 0
    goes_with: tuple[str, ...] = ()


def trust(
    context: FitContext,
    model: FittedModel,
    records: Sequence[Record],
    constants: Mapping[str, float],
    std: Mapping[str, float] | None = None,
) -> Trust:
    """Return the trust in the parameters of a model."""
    if not model.fit.free:
        return Trust(_NOTHING_FITTED)
    found = pieces(context, model)
    if found is None:
        return Trust(_NOT_SIMULATED)
    along = orders(context.rig, records, constants)
    errors = {**model.fit.standard_errors, **(std or {})}
    factors = _wider(model, errors)
    seen = {
        kind: view.widened(factors)
        for kind, view in views(found, [record.name for record in records], along).items()
    }
    open_numbers = _left_open(model)
    asked = [
        []
        if name in open_numbers
        else [(kind, found_in) for kind, view in seen.items() if (found_in := _reported(view, i))]
        for i, name in enumerate(found.free)
    ]
    p_values = iter(adjusted([one.p_value for of_number in asked for _, one in of_number]))
    allowed = [[next(p_values) for _ in of_number] for of_number in asked]
    own = roles(context.rig, _effect_parameters(model))
    numbers = tuple(
        _number(model, i, errors[name], seen, asked[i], allowed[i], along, own.get(name, Role.OTHER))
        for i, name in enumerate(found.free)
    )
    numbers = _of_the_drive(numbers, own)
    ordered = tuple(sorted(numbers, key=lambda n: (n.stable, n.p_value if not n.stable else 0.0)))
    pairs = entangled(model.fit)
    return Trust(statement(ordered, pairs, len(records), tuple(seen), open_numbers), ordered, pairs)


def _of_the_drive(numbers: tuple[ParameterTrust, ...], own: Mapping[str, Role]) -> tuple[ParameterTrust, ...]:
    """Return the parameters with a single cause if mass, stiffness and damping all rise or all fall with amplitude."""
    # They share one equation with the drive: if the drive gives less force, all of them appear larger.
    moved = [n for n in numbers if own.get(n.name) in (Role.MASS, Role.STIFFNESS, Role.DAMPING)]
    directions = {n.direction if n.pattern is Pattern.AMPLITUDE else 0 for n in moved}
    if (
        Role.MASS not in {own.get(n.name) for n in moved}
        or len(moved) < 2
        or len(directions) > 1
        or 0 in directions
    ):
        return numbers
    reported = meaning(Pattern.AMPLITUDE, Role.DRIVE, -directions.pop())
    return tuple(
        replace(n, points_to=reported) if reported and n in moved and not n.stable else n for n in numbers
    )


def _wider(model: FittedModel, std: Mapping[str, float]) -> Floats:
    """Return the factor by which bootstrap standard errors exceed those of the formula, at least 1, shape (n_free,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        formula = np.array([model.fit.standard_errors[name] for name in model.fit.free])
        ratios = np.array([std[name] for name in model.fit.free]) / formula
    return np.where((ratios > 1.0) & np.isfinite(ratios), ratios, 1.0)


def _left_open(model: FittedModel) -> tuple[str, ...]:
    """Return the positive parameters that all records together do not determine."""
    fit, lower = model.fit, {p.name: p.lower for p in model.fit.structure.parameters}
    return tuple(
        name
        for name in fit.free
        if lower[name] >= 0.0 and not fit.standard_errors[name] < POORLY_KNOWN * abs(fit.values[name])
    )


def _effect_parameters(model: FittedModel) -> set[str]:
    structure = model.fit.structure
    return {
        structure.parameter_name(effect, p.name) for effect in structure.effects for p in effect.parameters
    }


def _reported(view: View, index: int) -> Spread | None:
    """Return how a parameter differs in a view; None if nothing can be compared or another view has the same groups."""
    known, values, variances, freedom = view.of(index)
    if not view.is_tested or known.size < 2:
        return None
    if view.apart is None:
        return spread(values, variances, freedom)
    error = math.sqrt(view.apart.variances[index])
    if not 0.0 < error < math.inf:
        return None
    ratio = abs(float(view.apart.shifts[index])) / error
    known_by = float(view.apart.freedom[index])
    return Spread(float(2.0 * t_distribution.sf(ratio, known_by)), standard_errors(ratio, known_by))


def _number(
    model: FittedModel,
    index: int,
    std: float,
    seen: Mapping[str, View],
    asked: Sequence[tuple[str, Spread]],
    p_values: Sequence[float],
    along: Sequence[Order],
    role: Role,
) -> ParameterTrust:
    name = model.fit.free[index]
    unit = next(p.unit for p in model.fit.structure.parameters if p.name == name)
    value = model.fit.values[name]
    groups = {}
    for kind, view in seen.items():
        known, shifts, variances, _ = view.of(index)
        groups[kind] = tuple(
            GroupValue(view.labels[g], value + float(shift), math.sqrt(float(variance)))
            for g, shift, variance in zip(known, shifts, variances, strict=True)
        )
    differing = {kind: p for (kind, _), p in zip(asked, p_values, strict=True) if p <= TRUST.level}
    found = _Way(Pattern.STABLE if asked else Pattern.UNKNOWN)
    if differing:
        found = _pattern(seen, index, differing, along)
    return ParameterTrust(
        name=name,
        unit=unit,
        value=value,
        std=std,
        of_effect=role is Role.EFFECT,
        groups=groups,
        p_value=min(p_values, default=1.0),
        largest=max((one.largest for _, one in asked), default=0.0),
        pattern=found.pattern,
        direction=found.direction,
        goes_with=found.goes_with,
        points_to=meaning(found.pattern, role, found.direction),
    )


def _pattern(
    seen: Mapping[str, View], index: int, differing: Mapping[str, float], along: Sequence[Order]
) -> _Way:
    """Return how a number differs: first from record to record, then along records, then with the length of windows."""
    if set(differing) - {PORTION, WINDOW_LENGTH}:
        return _between_records(seen, index, differing, along)
    if PORTION in differing:
        known, values, variances, _ = seen[PORTION].of(index)
        found = course(values, variances, known.astype(float))
        return _Way(Pattern.PORTION, found.direction, ("time",))
    apart = seen[WINDOW_LENGTH].apart
    assert apart is not None
    return _Way(Pattern.WINDOW, 1 if apart.shifts[index] > 0.0 else -1, ("window length",))


def _between_records(
    seen: Mapping[str, View], index: int, differing: Mapping[str, float], along: Sequence[Order]
) -> _Way:
    view = seen[RECORD]
    known, values, variances, _ = view.of(index)
    courses = []
    for order in along:
        levels = np.array([order.levels[view.labels[g]] for g in known])
        found = course(values, variances, levels)
        if found.direction:
            courses.append((order, found))
    if courses:
        least = min(found.remainder for _, found in courses)
        best = [(order, found) for order, found in courses if found.remainder <= least]
        return _Way(best[0][0].pattern, best[0][1].direction, tuple(order.name for order, _ in best))
    # Levels of several records each that agree within and differ between need no order.
    for order in along:
        if order.name in differing and RECORD in differing and differing[order.name] < differing[RECORD]:
            return _Way(order.pattern, 0, (order.name,))
    return _Way(Pattern.RECORD)


def entangled(fit: FitResult) -> tuple[CorrelatedParameters, ...]:
    """Return the pairs of parameters with correlated errors, the highest correlation first."""
    found = []
    for i, j in itertools.combinations(range(len(fit.free)), 2):
        block = fit.covariance[np.ix_([i, j], [i, j])]
        if not (np.all(np.isfinite(block)) and np.all(np.diag(block) > 0.0)):
            continue
        correlation = float(block[0, 1] / np.sqrt(block[0, 0] * block[1, 1]))
        if abs(correlation) > TRUST.correlated:
            names = fit.free[i], fit.free[j]
            found.append(CorrelatedParameters(names, correlation, _text(fit, names, block, correlation)))
    return tuple(sorted(found, key=lambda pair: -abs(pair.correlation)))


def _text(fit: FitResult, names: tuple[str, str], block: np.ndarray, correlation: float) -> str:
    first, second = names
    values = np.array([fit.values[name] for name in names])
    if np.all(values != 0.0):
        relative = block / np.outer(values, values)
        alone = np.sqrt(np.diag(relative))
        sign = float(np.sign(relative[0, 1]))
        if abs(alone[1] / alone[0] - 1.0) < TRUST.one_to_one:
            together = float(np.sqrt(max(relative[0, 0] + relative[1, 1] - 2.0 * sign * relative[0, 1], 0.0)))
            what = f"ratio {first}/{second}" if sign > 0.0 else f"product {first}*{second}"
            return (
                f"{first} and {second} are determined only as the {what} ({percent(together)}); each alone only to "
                f"{percent(float(max(alone)))}."
            )
    freer = 1.0 / np.sqrt(max(1.0 - correlation**2, 1e-12))
    return (
        f"{first} and {second} can hardly be separated (correlation {correlation:.4f}): if one were known, the standard error of "
        f"the other would be {freer:.2g} times smaller."
    )


@dataclass(frozen=True)
class Spread:
    """Difference of a parameter between groups."""

    p_value: float  # probability of such differences if the parameter is the same in all
    # The largest difference from the mean of all groups, in standard errors of that difference; with few
    # degrees of freedom, the equivalent number of standard errors with the same probability.
    largest: float


def spread(values: Floats, variances: Floats, freedom: Floats) -> Spread:
    """Return the differences of one parameter between groups."""
    weights, n = 1.0 / variances, values.size
    total = float(np.sum(weights))
    away = values - float(weights @ values) / total
    uneven = float(np.sum((1.0 - weights / total) ** 2 / freedom))
    q = float(weights @ away**2)
    ratio = q / (n - 1) / (1.0 + 2.0 * (n - 2) / (n**2 - 1) * uneven)
    p_value = float(f_distribution.sf(ratio, n - 1, (n**2 - 1) / (3.0 * uneven)))
    alone = np.maximum(variances - 1.0 / total, np.finfo(float).tiny)
    return Spread(p_value, max(map(standard_errors, np.abs(away) / np.sqrt(alone), freedom)))


def standard_errors(ratio: float, freedom: float) -> float:
    """Return the number of known standard errors with the same probability as this number of estimated ones (Student)."""
    return float(-norm.ppf(np.maximum(t_distribution.sf(ratio, freedom), np.finfo(float).tiny)))


def adjusted(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for multiple tests (Holm)."""
    order, found, largest = np.argsort(p_values), [1.0] * len(p_values), 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[int(index)]))
        found[int(index)] = largest
    return found


@dataclass(frozen=True)
class Course:
    """Trend of a parameter with a quantity."""

    direction: int  # 1 if it rises, -1 if it falls, 0 otherwise
    remainder: float  # weighted sum of squares about the best monotonic trend


def course(values: Floats, variances: Floats, along: Floats) -> Course:
    """Return whether values of one parameter rise or fall with a quantity."""
    levels, place = np.unique(along, return_inverse=True)
    weights = 1.0 / variances
    total = np.bincount(place, weights)
    means = np.bincount(place, weights * values) / total
    whole = float(weights @ (values - float(weights @ values) / np.sum(weights)) ** 2)
    found = Course(0, whole)
    for direction in (1, -1) if levels.size > 1 else ():
        best = direction * isotonic_regression(direction * means, weights=total).x
        remainder = float(weights @ (values - best[place]) ** 2)
        freedom = max(1, values.size - np.unique(best).size)
        in_order = remainder <= (1.0 - TRUST.in_order) * whole or chi2.sf(remainder, freedom) > TRUST.level
        if np.ptp(best) > 0.0 and in_order and remainder < found.remainder:
            found = Course(direction, remainder)
    return found


RecordNumbers = dict[str, tuple[OwnNumber, ...]]
"""By the name of the record."""


def record_numbers(context: FitContext, model: FittedModel, hold: Hold) -> RecordNumbers:
    """Return the changes that the records ask for, one number at a time; nothing where an observer followed the motion."""
    if any(record.observed for record in context.records):
        return {}
    whole = Model.of(model.fit.structure, model.fit.values, hold)
    names = dict.fromkeys(record.origin for record in context.records)
    return {
        name: tuple(own_numbers(whole, [r for r in context.records if r.origin == name], context.noise))
        for name in names
    }
