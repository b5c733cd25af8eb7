"""How is a number with its uncertainty written? Only the digits that the records support."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rigsight.compare import Column
from rigsight.compare.score import Quantity
from rigsight.diagnose.result import Diagnosis, Estimate
from rigsight.effects import AT, Effect, kind_of, placed
from rigsight.rigs import Rig, declared_rig

UNDETERMINED = "not determined by these records"
ERRORS_HOLD = "Standard errors are of the noise alone: they hold if the equations of the rig do."
_QUANTITY_LABELS: dict[Quantity, str] = {
    "magnitude_rmse": "magnitude [{unit}]",
    "phase_rmse": "phase [{unit}]",
    "magnitude_db": "magnitude [dB]",
    "step_rmse": "step [{unit}]",
    "free_run_nrmse": "free run, NRMSE",
}


@dataclass(frozen=True)
class Written:
    """A number as text: ``(value +/- std) * 10^exponent``."""

    # Digits; std is empty where there is none.
    value: str
    std: str
    exponent: int  # power of ten outside the brackets, 0 for none


def written(value: float, std: float | None = None) -> Written:
    """Return value and standard error with two significant digits of the error; four digits of a value without one."""
    if not math.isfinite(value):
        return Written("not finite", "", 0)
    known = std is not None and math.isfinite(std) and std > 0.0
    size = max(abs(value), std if known and std is not None else 0.0)
    power = math.floor(math.log10(size)) if size > 0.0 else 0
    exponent = power if power >= 5 or power <= -4 else 0
    scale = 10.0**-exponent
    if not known or std is None:
        return Written(f"{value * scale:z.4g}", "", exponent)
    # At most ten digits: beyond, the standard error says more about the optimizer than about the rig.
    decimals = min(max(0, 1 - math.floor(math.log10(std * scale))), 9)
    return Written(f"{value * scale:z.{decimals}f}", f"{std * scale:.{decimals}f}", exponent)


def written_limits(low: float, high: float, std: float) -> tuple[Written, Written]:
    """Return the limits of an interval with two significant digits of the standard error, both with the same power of ten."""
    size = max(abs(low), abs(high))
    power = math.floor(math.log10(size)) if size > 0.0 else 0
    exponent = power if power >= 5 or power <= -4 else 0
    scale = 10.0**-exponent
    decimals = min(max(0, 1 - math.floor(math.log10(std * scale))), 9)
    first, last = (Written(f"{limit * scale:z.{decimals}f}", "", exponent) for limit in (low, high))
    return first, last


def estimate_text(estimate: Estimate) -> str:
    """Return an estimate in ASCII, e.g. ``"81.2 +/- 1.3 N m/rad"``."""
    number = written(estimate.value, estimate.std)
    unit = "" if estimate.unit in ("", "1") else f" {estimate.unit}"
    power = f"e{number.exponent:+d}" if number.exponent else ""
    if not math.isfinite(estimate.std):
        return UNDETERMINED
    if not number.std:
        return f"{number.value}{power}{unit}"
    inside = f"{number.value} +/- {number.std}"
    return f"({inside}){power}{unit}" if power else f"{inside}{unit}"


def gap_percent(value: float) -> str:
    """Return an NRMSE as percent with three digits, of a model that left the record with two."""
    if not math.isfinite(value):
        return "not finite"
    if value < 10.0:
        return f"{100.0 * value:.3g} %"
    rounded = f"{100.0 * value:.1e}"
    return f"{float(rounded):.0f} %" if value < 1e5 else f"{rounded} %"


def column_label(column: Column) -> str:
    """Return what a column of a comparison holds, in ASCII: ``"u -> psi, phase [rad]"``."""
    return f"{column.signal}, {_QUANTITY_LABELS[column.quantity].format(unit=column.unit)}"


def error_text(value: float | None, quantity: Quantity) -> str:
    """Return an error with three digits; an NRMSE in percent; a dash where there is none."""
    if value is None:
        return "-"
    return gap_percent(value) if quantity == "free_run_nrmse" else f"{value:.3g}"


def rig_of(diagnosis: Diagnosis) -> Rig | None:
    """Return the rig; None for a result that only names one that is not built in."""
    return declared_rig(diagnosis.rig, diagnosis.model.get("declaration", {}))


def effect_of(name: str, known: Mapping[str, Effect]) -> Effect | None:
    """Return the effect of this name at its place, None where it is not known."""
    effect = known.get(kind_of(name))
    place = name.partition(AT)[2]
    return placed(effect, place) if effect is not None and place else effect
