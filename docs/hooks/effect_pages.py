"""What does the page of an effect say? Everything on it comes from the effect's declaration and its file's docstring."""

from __future__ import annotations

import math
import re

from effect_text import EffectText, effect_text

from rigsight.effects import CATALOGUE, Effect, GainTrend, Place
from rigsight.parameters import Parameter
from rigsight.report.labels import effect_label, listed, sentence_case
from rigsight.report.render import equations_of
from rigsight.rigs import RIGS
from rigsight.workflow.own.effect_benches import ELEMENT_BENCH, bench_of

_PLACES = {
    Place.ACTUATOR: "actuator",
    Place.CONTROLLER: "controller",
    Place.DYNAMICS: "dynamics",
    Place.DISTURBANCE: "disturbance",
    Place.LATERAL_DYNAMICS: "lateral dynamics",
    Place.SENSOR: "sensor",
}
_TRENDS = {
    GainTrend.RISES: "rises with amplitude",
    GainTrend.FALLS: "falls with amplitude",
    GainTrend.STEADY: "the same at every amplitude",
}
_UNBOUNDED = 1e6
"""A bound beyond this keeps a simulation finite and says nothing of an effect."""


def index_page() -> str:
    """Return the page that lists all effects."""
    rows = [
        f"| [{_title(effect)}]({effect.name}.md) | {_PLACES[effect.place]} | {effect.summary} |"
        for effect in CATALOGUE
    ]
    return "\n".join(
        [
            "# The catalogue of effects",
            "",
            f"A diagnosis can name these {len(CATALOGUE)} effects, and up to five of them at once. Each page is generated from "
            "the file that declares the effect: the equation shown is the one that is simulated and fitted.",
            "",
            "| effect | where it acts | description |",
            "|---|---|---|",
            *rows,
            "",
            "An effect that is not in the catalogue can be added without changing the package: "
            "[effects of your own](../own_effects.md).",
            "",
        ]
    )


def effect_page(effect: Effect) -> str:
    """Return the page of an effect; its pictures, `NAME-1-light.svg` to `NAME-2-dark.svg`, are beside it."""
    text = effect_text(effect)
    parts = [
        f"# {_title(effect)}",
        f"{text.title}. {effect.summary}",
        _facts(effect),
        "## Equation",
        _equations(effect),
        "As written in the file of the effect:",
        text.equation,
        "## Parameters",
        _parameters(effect),
        "## Signature",
        text.signature,
        _pictures(effect),
        _caption(effect),
        "## When it applies",
        text.applies,
        "## How to distinguish it from similar effects",
        _neighbors(effect),
        "## References",
        text.references,
        f"Declared in `src/rigsight/effects/{effect.name}.py`.",
    ]
    return "\n\n".join(parts) + "\n"


def _title(effect: Effect) -> str:
    return sentence_case(effect_label(effect.name))


def _facts(effect: Effect) -> str:
    rigs = [f"`{rig.name}`" for rig in RIGS.values() if rig.offers(effect)]
    harmonics = "even and odd" if effect.signature.even_harmonics else "odd only, if any"
    rows = {
        "name": f"`{effect.name}`",
        "where it acts": _PLACES[effect.place],
        "energy over a cycle": effect.energy.value,
        "gain below resonance": _TRENDS[effect.signature.gain_trend],
        "harmonics of a sine": harmonics,
        "rigs that offer it": listed(rigs),
    }
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows.items())])


def _equations(effect: Effect) -> str:
    motion, own = equations_of(bench_of(effect).rig, [effect])
    groups = (
        ("The effect:", own.equations),
        (f"In the equation of the {motion.title.lower()}:", motion.equations),
    )
    return "\n\n".join(
        f'{heading}\n\n<div class="equation" data-search-exclude>{"".join(equations)}</div>'
        for heading, equations in groups
    )


def _parameters(effect: Effect) -> str:
    # At each joint of larger rigs the units are those of its own motion.
    rigs = [rig for rig in RIGS.values() if rig.has_one_motion and rig.offers(effect)]
    names = [rig.name.replace("_", " ") for rig in rigs]
    head = [
        "symbol",
        "meaning",
        *(f"unit, {name}" for name in names),
        "bounds",
        "without effect at",
        "search range",
    ]
    rows = [head, ["---"] * len(head)]
    for p in effect.parameters:
        units = [rig.with_unit(p).unit for rig in rigs]
        null = "" if p.null is None else _number(p.null)
        rows.append([f"`{p.name}`", p.description, *units, _bounds(p), null, _search(p)])
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    return (
        f"{table}\n\nBounds are in the rig's units. The search range is in characteristic units: 1 is the typical size of "
        "such a parameter for the records."
    )


def _bounds(p: Parameter) -> str:
    low, high = abs(p.lower) < _UNBOUNDED, abs(p.upper) < _UNBOUNDED
    if 0.0 < p.lower < 1e-5 and not high:
        return "above 0"
    if low and high:
        return f"{_number(p.lower)} to {_number(p.upper)}"
    if low:
        return f"{_number(p.lower)} or more"
    return f"{_number(p.upper)} or less" if high else "any"


def _search(p: Parameter) -> str:
    if not p.fitted:
        return f"held at {_number(p.default or 0.0)}"
    return f"{_number(p.search[0])} to {_number(p.search[1])}"


def _number(value: float) -> str:
    if math.isinf(value) or abs(value) >= 1e12:
        return "very large"
    return f"{value:g}".replace("-", "\u2212") if abs(value) < 1e5 else f"{value:.0e}"


def _pictures(effect: Effect) -> str:
    seen = f"Responses of a rig with and without {effect_label(effect.name)}"
    links = [
        f"![{seen}, {number}]({effect.name}-{number}-{scheme}.svg#only-{scheme})"
        for number in (1, 2)
        for scheme in ("light", "dark")
    ]
    return "\n".join(['<div class="panels" markdown="span">', *links, "</div>"])


def _caption(effect: Effect) -> str:
    if effect.place is Place.SENSOR:
        how = "Running gear with the numbers of the thesis; the frequency is that of the drive."
    elif effect.lateral is not None:
        how = "Running gear with the numbers of the thesis: lateral displacement over motor current."
    elif bench_of(effect) is ELEMENT_BENCH:
        how = "Element with d = 2 N s/m, k = 100 N/m: force over the frequency of the prescribed motion."
    elif effect.place is Place.CONTROLLER:
        how = "Position drive with m = 1 kg, d = 1 N s/m, k_p = 100 N/m and k_v = 3 N s/m: displacement over goal."
    else:
        how = "Axis with m = 1 kg, d = 2 N s/m, k = 100 N/m: it resonates at 10 rad/s."
    return (
        f"*Simulated when this site was built, in steady state, one frequency at a time. {how} The start values of the effect "
        "with the largest influence are used; if the response changes with amplitude, they are scaled for amplitude 1. A line "
        "ends where the rig sticks or leaves the range in which the equation is valid.*"
    )


def _neighbors(effect: Effect) -> str:
    rows = []
    for other in CATALOGUE:
        relation = _relation(effect, other)
        if other is not effect and relation:
            rows.append(
                f"| [{_title(other)}]({other.name}.md) | {relation} | {_one_line(effect_text(other).signature)} |"
            )
    alike = [
        f"[{effect_label(other.name)}]({other.name}.md)"
        for other in CATALOGUE
        if other is not effect and other.place is effect.place and other.signature == effect.signature
    ]
    parts = []
    if rows:
        table = ["| similar effect | relation | its signature |", "|---|---|---|", *rows]
        parts.append("\n".join(table))
    if alike:
        parts.append(
            "At the same place, with the same trend of the gain and the same kind of harmonics: "
            f"{listed(alike)}. The trend does not distinguish these effects, but its form does: compare the fits to records of "
            "several amplitudes, and the errors on records that were not fitted."
        )
    if not parts:
        parts.append("No other effect of the catalogue acts at this place with the same trend and harmonics.")
    parts.append(
        "If records do not distinguish two effects, the diagnosis names both (`ambiguous_with`): "
        "[how the verdict is reached](../verdict.md)."
    )
    return "\n\n".join(parts)


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _relation(effect: Effect, other: Effect) -> str:
    if other.name in effect.parents:
        return "a special or limiting case of this effect; it wins a tie"
    if effect.name in other.parents:
        return "contains this effect as a special or limiting case; this effect wins a tie"
    if _names(effect_text(effect), other):
        return "named in the description of this effect"
    return "its description names this effect" if _names(effect_text(other), effect) else ""


def _names(text: EffectText, other: Effect) -> bool:
    """Return True if a text names an effect, in any order of the words of its name: "delay of the input"."""
    sentences = re.split(r"[.;:]", " ".join(f"{text.applies} {text.equation}".lower().split()))
    words = effect_label(other.name).lower().split()
    return any(
        all(re.search(rf"\b{re.escape(word)}\b", sentence) for word in words) for sentence in sentences
    )
