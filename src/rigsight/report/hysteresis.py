"""How is a rig with effects of memory shown: its parameters, what follows from them, and the error without and with them?"""

from __future__ import annotations

import math
from collections.abc import Iterator

from rigsight.diagnose.result import Estimate
from rigsight.identify.hysteresis.derived import LEVEL, Derived
from rigsight.identify.identification import HysteresisIdentification
from rigsight.report.quantities import UNDETERMINED, estimate_text, gap_percent

HEADING = "Hysteresis"


def hysteresis_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: parameters, what follows from them, and the errors of each record.

    Parameters
    ----------
    found
        The result.
    """
    yield from parameter_rows(found)
    yield from derived_rows(found)
    for record, role, without, with_effects in error_rows(found):
        yield record, f"{role}, NRMSE {without} without, {with_effects} with the effects"


def parameter_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield name and value with standard error of each parameter."""
    fit = found.calibration.fit
    for name in fit.free:
        yield name, estimate_text(Estimate(fit.values[name], fit.standard_errors[name], found.units[name]))
    for name, value in found.held.items():
        unit = found.units[name]
        yield name, f"{value:.4g}{'' if unit in ('', '1') else f' {unit}'}, held"


def derived_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield name and value with interval of each quantity that follows from the parameters."""
    derived = found.calibration.derived
    for pair in derived.pairs:
        yield pair.name, derived_text(pair)
    if derived.saturation is not None:
        yield derived.saturation.name, derived.saturation_in_words
    for area in derived.loop_areas:
        yield area.energy.name, derived_text(area.energy)


def error_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str, str, str]]:
    """Yield record, role, and the errors of its outputs without and with the effects."""
    for score in found.scores:
        without, with_effects = (
            ", ".join(f"{name} {gap_percent(value)}" for name, value in errors.items()) or "-"
            for errors in (score.without, score.nrmse)
        )
        yield score.record, score.role, without, with_effects


def derived_text(one: Derived) -> str:
    """Return a value with its interval, e.g. ``"0.0318 J (95 %: 0.0317 to 0.0319)"``."""
    if not (math.isfinite(one.lower) and math.isfinite(one.upper)):
        return UNDETERMINED
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    width = one.upper - one.lower
    value, lower, upper = (_as_fine_as(number, width) for number in (one.value, one.lower, one.upper))
    return f"{value}{unit} ({100.0 * LEVEL:.0f} %: {lower} to {upper})"


def _as_fine_as(value: float, width: float) -> str:
    """Return a number with two significant digits of the width of its interval."""
    if value == 0.0 or width <= 0.0:
        return f"{value:.4g}"
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(width)) + 2
    return f"{value:.{min(max(digits, 2), 10)}g}"
