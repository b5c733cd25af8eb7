"""How is a rig with effects of memory shown: its parameters, what follows from them, and the error without and with them?"""

from __future__ import annotations

import math
from collections.abc import Iterator

from rigsight.diagnose.result import Estimate
from rigsight.identify.hysteresis.derived import LEVEL, Derived
from rigsight.identify.identification import HysteresisIdentification
from rigsight.report.quantities import UNDETERMINED, Written, estimate_text, gap_percent, written

HEADING = "Hysteresis"
_WIDTHS = 3.92
"""Standard deviations between the ends of a 95 % interval."""


ERROR_HEADS = ("record", "role", "NRMSE without the effects", "with the effects")


def hysteresis_rows(found: HysteresisIdentification) -> Iterator[tuple[str, str]]:
    """Yield subject and words: parameters, and what follows from them."""
    yield from parameter_rows(found)
    yield from derived_rows(found)


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
    """Return a value with its interval, e.g. ``"0.0318 J (95 %: 0.0316 to 0.0320)"``."""
    if not (math.isfinite(one.lower) and math.isfinite(one.upper)):
        return UNDETERMINED
    unit = "" if one.unit in ("", "1") else f" {one.unit}"
    spread = (one.upper - one.lower) / _WIDTHS
    value, lower, upper = (_plain(written(number, spread)) for number in (one.value, one.lower, one.upper))
    return f"{value}{unit} ({100.0 * LEVEL:.0f} %: {lower} to {upper})"


def _plain(number: Written) -> str:
    return f"{number.value}e{number.exponent:+d}" if number.exponent else number.value
