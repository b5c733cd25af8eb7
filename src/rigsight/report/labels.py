"""What are effects, places, families and shares called, and how is a number written? With digits that records support."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigsight.effects import AT, Effect, kind_of, placed
from rigsight.metrics import TWO_SIDED
from rigsight.parameters import Parameter
from rigsight.rigs import Rig
from rigsight.rigs.built_in import declared_rig
from rigsight.units import behind

if TYPE_CHECKING:
    from rigsight.compare import Column
    from rigsight.compare.comparison import Quantity
    from rigsight.diagnose.location.gap_parts import PathPart
    from rigsight.diagnose.result import Diagnosis, Estimate
    from rigsight.diagnose.verdict.families import FamilyAtPlace
    from rigsight.inverse import ProposedCause

TIMES = "\u00d7"
_WITHOUT_EFFECT = "no effect, refitted parameters"
_PROPER_NAMES = {
    "bouc wen": "Bouc-Wen",
    "coulomb": "Coulomb",
    "stribeck": "Stribeck",
    "iwan": "Iwan",
    "maxwell": "Maxwell",
    "lugre": "LuGre",
    "pid ": "PID ",
}
_PLACES = {
    "actuator": "at the actuator",
    "controller": "at the controller",
    "sensor": "at the sensor",
    "disturbance": "as a disturbance from outside",
    "lateral_dynamics": "in the lateral dynamics",
    "yaw_dynamics": "in the yaw dynamics",
    "dynamics": "in the dynamics",
}
_FORMS = 4
"""Number of forms of a family that are shown."""
UNDETERMINED = "not determined by these records"
ERRORS_HOLD = "Standard errors are of the noise alone: they hold if the equations of the rig do."
_QUANTITY_LABELS: dict[Quantity, str] = {
    "magnitude_rmse": "magnitude [{unit}]",
    "phase_rmse": "phase [{unit}]",
    "magnitude_db": "magnitude [dB]",
    "step_rmse": "step [{unit}]",
    "free_run_nrmse": "free run, NRMSE",
}


def listed(items: Iterable[str], last: str = "and") -> str:
    """Return ``"a, b and c"``."""
    texts = list(items)
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} {last} {texts[-1]}" if texts else ""


def effect_label(name: str) -> str:
    """Return an effect's name for people: ``"Bouc-Wen hysteresis"``, ``"Coulomb friction at load_bearing"``."""
    kind, _, place = name.partition(AT)
    label = kind.replace("_", " ")
    for written, proper in _PROPER_NAMES.items():
        label = label.replace(written, proper)
    return f"{label} at {place}" if place else label


def effects_label(effects: Sequence[str]) -> str:
    """Return the names of a set of effects for people."""
    return listed(map(effect_label, effects)) or _WITHOUT_EFFECT


def sentence_case(text: str) -> str:
    """Return the text with a capital first letter, the rest untouched."""
    return text[:1].upper() + text[1:]


def place_label(where: str) -> str:
    """Return a place with its preposition: ``"in the yaw dynamics"``."""
    return _PLACES.get(where, f"at {where}")


def percent(share: float) -> str:
    """Return a share as percent; what is nearly but not quite all is not rounded up to all."""
    if not math.isfinite(share):
        return "an unknown share"
    if share >= 1.0:
        return "100 %"
    if share > 0.999:
        return "over 99.9 %"
    return f"{100.0 * share:.1f} %" if share > 0.99 else f"{100.0 * share:.0f} %"


def family_label(own: FamilyAtPlace | ProposedCause) -> str:
    """Return a family with its place: ``"dry friction at gearbox"``."""
    return f"{own.family.replace('_', ' ')} {place_label(own.where)}"


def forms_label(own: FamilyAtPlace) -> str:
    """Return the forms of a family with their probabilities above 0 %: ``"Stribeck friction 60 %, Coulomb friction 40 %"``."""
    shown = ((effects_label(form.effects), percent(form.probability)) for form in own.forms[:_FORMS])
    return ", ".join(f"{form} {probability}" for form, probability in shown if probability != percent(0.0))


def share_label(own: FamilyAtPlace | ProposedCause) -> str:
    """Return the share of the gap of a family with its interval: ``"81 % (74 % to 86 %)"``; below zero it explains nothing."""
    share = percent(own.share)
    low, high = (percent(max(0.0, end)) for end in own.interval)
    return share if low == high == share else f"{share} ({low} to {high})"


def gap_of_shares(diagnosis: Diagnosis) -> str:
    """Return of what the shares of families are: of a gap of the sensors, or of the force along the motion."""
    of_motion = diagnosis.shares is not None and diagnosis.shares.of == "motion"
    return "squared force that the equations leave along the motion" if of_motion else "squared gap"


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
    if std is None or not math.isfinite(std) or std <= 0.0:
        exponent = _exponent(abs(value))
        return Written(f"{value * 10.0**-exponent:z.4g}", "", exponent)
    exponent = _exponent(max(abs(value), std))
    decimals, scale = _decimals(std, exponent), 10.0**-exponent
    return Written(f"{value * scale:z.{decimals}f}", f"{std * scale:.{decimals}f}", exponent)


def written_limits(low: float, high: float, std: float) -> tuple[Written, Written]:
    """Return the limits of an interval with two significant digits of the standard error, both with the same power of ten."""
    exponent = _exponent(max(abs(low), abs(high)))
    decimals = _decimals(std, exponent)
    first, last = (Written(f"{limit * 10.0**-exponent:z.{decimals}f}", "", exponent) for limit in (low, high))
    return first, last


@dataclass(frozen=True)
class ParameterRow:
    """A parameter, or a combination of some, in a table; a remark stands where the records do not determine it."""

    name: str
    number: Written
    unit: str
    description: str
    interval: tuple[Written, ...] = ()  # 95 %, empty where there is none
    remark: str = ""
    given: str = ""  # value in the given simulation, empty where that has none


def parameter_row(
    name: str, estimate: Estimate, parameter: Parameter | None = None, given: str = "", description: str = ""
) -> ParameterRow:
    """Return an estimate with its 95 % interval, cut where the parameter's own range ends."""
    value, std = estimate.value, estimate.std
    interval: tuple[Written, ...] = ()
    if math.isfinite(value) and math.isfinite(std) and std > 0.0:
        low, high = value - TWO_SIDED * std, value + TWO_SIDED * std
        if parameter is not None:
            low, high = max(low, parameter.lower), min(high, parameter.upper)
        interval = written_limits(low, high, std)
    remark = "" if math.isfinite(std) else UNDETERMINED
    about = description if parameter is None else parameter.description
    return ParameterRow(name, written(value, std), estimate.unit, about, interval, remark, given)


def _exponent(size: float) -> int:
    """Return the power of ten that is written outside of a number of this size: none but for large and small ones."""
    power = math.floor(math.log10(size)) if size > 0.0 else 0
    return power if power >= 5 or power <= -4 else 0


def _decimals(std: float, exponent: int) -> int:
    # At most ten digits: beyond, the standard error says more about the optimizer than about the rig.
    return min(max(0, 1 - math.floor(math.log10(std * 10.0**-exponent))), 9)


def plain(number: Written) -> str:
    """Return a number in ASCII, e.g. ``"(3.10 +/- 0.02)e+5"``."""
    inside = f"{number.value} +/- {number.std}" if number.std else number.value
    if not number.exponent:
        return inside
    return f"({inside})e{number.exponent:+d}" if number.std else f"{inside}e{number.exponent:+d}"


def estimate_text(estimate: Estimate) -> str:
    """Return an estimate in ASCII, e.g. ``"81.2 +/- 1.3 N m/rad"``."""
    if not math.isfinite(estimate.std):
        return UNDETERMINED
    return f"{plain(written(estimate.value, estimate.std))}{behind(estimate.unit)}"


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


def shift_text(part: PathPart) -> str:
    """Return the delay with which a leg of the signal path follows best, and its gap then; empty where none was tested."""
    delay = f"{1e3 * part.shift:.3g} ± {1e3 * part.shift_std:.1g} ms, then {gap_percent(part.shifted)}"
    return delay.replace("-", "\u2212") if math.isfinite(part.shift) else ""
