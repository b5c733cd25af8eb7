"""What are effects, places, families and shares called, on the page and on the terminal?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from rigsight.diagnose.verdict.families import FamilyAtPlace
from rigsight.effects import AT
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


def unit_text(unit: str) -> str:
    """Return a unit as it follows a number; an axis calls the unit of its input just that."""
    return "" if unit in ("input", "1") else unit


def family_label(own: FamilyAtPlace | ProposedCause) -> str:
    """Return a family with its place: ``"dry friction at gearbox"``."""
    return f"{own.family.replace('_', ' ')} {place_label(own.where)}"


def forms_label(own: FamilyAtPlace) -> str:
    """Return the forms of a family with their probabilities within it: ``"Stribeck friction 60 %, Coulomb friction 40 %"``."""
    return ", ".join(
        f"{effects_label(form.effects)} {percent(form.probability)}" for form in own.forms[:_FORMS]
    )


def share_label(own: FamilyAtPlace) -> str:
    """Return the share of the gap of a family with its interval: ``"81 % (74 % to 86 %)"``."""
    low, high = map(percent, own.interval)
    return f"{percent(own.share)} ({low} to {high})"
