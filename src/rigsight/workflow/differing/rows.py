"""Which numbers differ between diagnoses? Each by its errors, and by the scatter between records that these do not include.

References
----------
S. Holm, Scand. J. Stat. 6 (1979) 65, for several tests. W. G. Cochran, J. R. Stat. Soc. Suppl. 4 (1937) 102, for the test of
homogeneity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.stats import chi2, norm

from rigsight.diagnose.trust.trust import adjusted
from rigsight.identify.information import POORLY_KNOWN
from rigsight.records.record import Floats
from rigsight.workflow.differing.units import Known, Unit

FALSE_ALARMS = 0.05
"""Probability that any number of a table is called changed if none is (Holm)."""


class Verdict(StrEnum):
    """What can be said of a number."""

    CHANGED = "changed"
    LOOKS_CHANGED = "only looks changed"
    UNKNOWN = "not determined"
    SAME = "same"
    NOT_EVERYWHERE = "not in every model"


@dataclass(frozen=True)
class Trend:
    """Weighted regression of a number over an axis."""

    slope: float
    std: float
    p_value: float  # adjusted for all tests of the table


@dataclass(frozen=True)
class Row:
    """A number in each diagnosis."""

    name: str
    unit: str
    values: tuple[Known | None, ...]
    verdict: Verdict
    # The last minus the first, in standard errors of that difference with the scatter between records; NaN where it is unknown.
    difference: float
    p_errors: float  # of such differences by the standard errors alone, adjusted for all tests; NaN where it was not tested
    p_value: float  # the same with the scatter between records
    trend: Trend | None  # for more than two diagnoses


@dataclass(frozen=True)
class _Tested:
    """The probabilities of one number, before they are adjusted."""

    by_errors: float
    by_scatter: float
    slope: tuple[float, float, float] | None  # slope, its standard error and its probability


def rows_of(units: Sequence[Unit], along: Sequence[float]) -> tuple[Row, ...]:
    """Return a row for each number of any model, those that changed first."""
    names = list(dict.fromkeys(name for unit in units for name in unit.numbers))
    values = {name: tuple(unit.numbers.get(name) for unit in units) for name in names}
    tested = {
        name: _tested([own for own in known if own is not None], along)
        for name, known in values.items()
        if all(own is not None and _is_determined(own) for own in known)
    }
    errors = dict(zip(tested, adjusted([own.by_errors for own in tested.values()]), strict=True))
    kinds = [(name, kind) for name, own in tested.items() for kind in (0, 1) if kind == 0 or own.slope]
    raw = [
        tested[name].by_scatter if kind == 0 else (tested[name].slope or (0.0, 0.0, 1.0))[2]
        for name, kind in kinds
    ]
    scatter = dict(zip(kinds, adjusted(raw), strict=True))
    found = []
    for name, known in values.items():
        own, trend = tested.get(name), None
        p_errors = errors.get(name, math.nan)
        p_value = scatter.get((name, 0), math.nan)
        if own is not None and own.slope is not None:
            trend = Trend(own.slope[0], own.slope[1], scatter[name, 1])
        unit = next(unit.units[name] for unit in units if name in unit.units)
        verdict = _verdict(known, p_errors, min(p_value, trend.p_value if trend else math.inf))
        found.append(Row(name, unit, known, verdict, _difference(known), p_errors, p_value, trend))
    order = list(Verdict)
    return tuple(sorted(found, key=lambda row: (order.index(row.verdict), row.p_value)))


def _is_determined(own: Known) -> bool:
    return math.isfinite(own.std) and own.std > 0.0


def _verdict(known: Sequence[Known | None], p_errors: float, p_value: float) -> Verdict:
    if any(own is None for own in known):
        return Verdict.NOT_EVERYWHERE
    if p_value <= FALSE_ALARMS:
        return Verdict.CHANGED
    if p_errors <= FALSE_ALARMS:
        return Verdict.LOOKS_CHANGED
    loose = [own for own in known if own is not None and not own.with_scatter < POORLY_KNOWN * abs(own.value)]
    return Verdict.UNKNOWN if loose else Verdict.SAME


def _difference(known: Sequence[Known | None]) -> float:
    first, last = known[0], known[-1]
    if first is None or last is None:
        return math.nan
    error = math.hypot(first.with_scatter, last.with_scatter)
    return (last.value - first.value) / error if 0.0 < error < math.inf else math.nan


def _tested(known: Sequence[Known], along: Sequence[float]) -> _Tested:
    values = np.array([own.value for own in known])
    plain, wide = (np.array([getattr(own, kind) for own in known]) for kind in ("std", "with_scatter"))
    slope = _slope(values, wide, np.array(along)) if values.size > 2 else None
    return _Tested(_homogeneity(values, plain), _homogeneity(values, wide), slope)


def _homogeneity(values: Floats, std: Floats) -> float:
    """Return the probability of such differences if all values are the same."""
    weights = 1.0 / std**2
    away = values - float(weights @ values) / float(np.sum(weights))
    return float(chi2.sf(weights @ away**2, values.size - 1))


def _slope(values: Floats, std: Floats, along: Floats) -> tuple[float, float, float] | None:
    """Return the slope of a weighted regression, its standard error and the probability of such a slope by chance."""
    weights = 1.0 / std**2
    x = along - float(weights @ along) / float(np.sum(weights))
    size = float(weights @ x**2)
    if size == 0.0:
        return None
    slope = float(weights @ (x * values)) / size
    error = 1.0 / math.sqrt(size)
    return slope, error, float(2.0 * norm.sf(abs(slope) / error))
