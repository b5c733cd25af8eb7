"""What the records of a campaign can show, and a planned experiment, each as one self-contained HTML page without a script."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rigsight.check import Check, EffectMatrix, Told, Visible
from rigsight.effects import kind_of
from rigsight.plan import Plan, Sizes
from rigsight.report.figures import page_figure
from rigsight.report.labels import effect_label, listed, percent, place_label
from rigsight.report.render import rendered
from rigsight.units import INPUT_UNIT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TOLD_WORDS: Mapping[Told, str] = {
    "apart": "told apart by these records",
    "by size": "depends on their size",
    "other motion": "only by another motion",
    "alike": "alike to 5 %, what laws of real rigs err",
}
VISIBLE_WORDS: Mapping[Visible, str] = {
    "yes": "",
    "at some sizes": "shows beside the parameters at some sizes only",
    "no": "does not show beside the parameters",
}
_SIGNS: Mapping[Told, str] = {"apart": "", "by size": "~", "other motion": "+", "alike": "="}


@dataclass(frozen=True)
class Rivals:
    """One effect, and those of other families that the records do not tell apart from it."""

    effect: str
    where: str
    visible: str  # in words; empty where it shows for most sizes
    others: tuple[tuple[str, str], ...]  # what would tell them apart, and their names


def render_check(found: Check, command: str, versions: Mapping[str, str]) -> str:
    """Return the page of a check."""
    severities = [remark.severity for remark in found.remarks]
    return rendered(
        "check.html.jinja",
        command or "from Python",
        versions,
        check=found,
        n_faults=severities.count("fault"),
        n_warnings=severities.count("warning"),
        n_determined=sum(p.status == "determined" for p in found.parameters),
        rivals=list(rivals(found.matrix)),
        forms=list(forms(found.matrix)),
        heads=[short_label(found.matrix, i) for i in range(len(found.matrix.effects))],
        not_judged=sorted({effect_label(kind_of(effect)) for effect in found.matrix.not_judged}),
        headline=check_headline(found),
        signs=_SIGNS,
        told_words=TOLD_WORDS,
        classes={told: told.replace(" ", "-") for told in TOLD_WORDS},
    )


def check_headline(found: Check) -> str:
    """Return the result of a check in one sentence."""
    severities = [remark.severity for remark in found.remarks]
    faults, warnings = severities.count("fault"), severities.count("warning")
    if faults:
        return f"{_count(faults, 'fault')} of the records would make numbers wrong."
    return (
        f"The records can be used; {_count(warnings, 'warning')}." if warnings else "The records can be used."
    )


def rivals(matrix: EffectMatrix) -> Iterator[Rivals]:
    """Yield each effect that the records do not tell apart from all others of other families."""
    for i in range(len(matrix.effects)):
        others: dict[str, list[str]] = {}
        for j in range(len(matrix.effects)):
            if matrix.told[i][j] != "apart" and _family(matrix, i) != _family(matrix, j):
                by = matrix.motions.get((max(i, j), min(i, j)), TOLD_WORDS[matrix.told[i][j]])
                others.setdefault(by, []).append(short_label(matrix, j))
        if others or VISIBLE_WORDS[matrix.visible[i]]:
            named = tuple((by, listed(names)) for by, names in others.items())
            effect, where = effect_label(kind_of(matrix.effects[i])), matrix.where[i].replace("_", " ")
            yield Rivals(effect, where, VISIBLE_WORDS[matrix.visible[i]], named)


def forms(matrix: EffectMatrix) -> Iterator[tuple[str, str]]:
    """Yield each family at a place with its forms that the records do not tell apart."""
    families = [_family(matrix, i) for i in range(len(matrix.effects))]
    for family in dict.fromkeys(families):
        own = [i for i, other in enumerate(families) if other == family]
        alike = [i for i in own if any(j != i and matrix.told[i][j] != "apart" for j in own)]
        if alike:
            names = [effect_label(kind_of(matrix.effects[i])) for i in alike]
            yield f"{family[0].replace('_', ' ')} {place_label(family[1])}", listed(names)


def _family(matrix: EffectMatrix, i: int) -> tuple[str, str]:
    return str(matrix.families[i]), matrix.where[i]


def short_label(matrix: EffectMatrix, i: int) -> str:
    """Return the name of an effect, with its place where it is judged at several."""
    kinds = [kind_of(effect) for effect in matrix.effects]
    alone = kinds.count(kinds[i]) == 1
    return effect_label(kinds[i]) if alone else f"{effect_label(kinds[i])}, {matrix.where[i]}"


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


_SIZES: Mapping[Sizes, str] = {
    "fitted": "Each rival was fitted to the records.",
    "usual": "No verdict named the rivals: they have a usual size. Each was fitted to the records as they would be if another "
    "one were true.",
    "usual, no records": "There are no records yet: the rivals have a usual size, the rig the numbers of its file.",
}
_GAIN = 0.05
"""Gain of probability below which an experiment is not worth its time (a convention)."""


def render_plan(plan: Plan, picture: Figure, command: str, versions: Mapping[str, str], seed: int) -> str:
    """Return the page of a plan."""
    record = plan.record
    shown = {name: "" if unit == INPUT_UNIT else unit for name, unit in record.units.items()}
    units = {}
    for limit, _ in plan.limits:
        unit = shown.get(limit.signal, "")
        units[limit.name] = f"{unit or '1'}/s" if limit.is_rate else unit
    return rendered(
        "plan.html.jinja",
        command or "from Python",
        versions,
        seed,
        plan=plan,
        headline=plan_headline(plan),
        instructions=[
            f"plan.csv holds the time and every input at {1.0 / record.dt:.5g} Hz, in SI units.",
            "Measure every sensor meanwhile, and list the record in the campaign.",
        ],
        picture=page_figure(
            picture,
            "plan",
            plan_headline(plan),
            "The inputs, the readings that each rival predicts, and what is left of them.",
        ),
        units=units,
        sizes=_SIZES[plan.sizes],
        promise=promise(plan),
    )


def plan_headline(plan: Plan) -> str:
    """Return what to play in a sentence."""
    constants = ", ".join(f"{name} = {value:g}" for name, value in plan.record.constants.items())
    return f"Play: {plan.what}, {plan.record.duration:g} s{f', with {constants}' if constants else ''}."


def promise(plan: Plan) -> str:
    """Return what to expect afterwards."""
    trials = plan.trials
    gains = plan.promised > plan.now + _GAIN
    return (
        f"{'' if gains else 'No record within these limits tells these rivals apart. '}"
        f"Expected probability of the cause afterwards: {plan.promised:.2f}, now {plan.now:.2f}. "
        f"In {trials.n} simulated outcomes the cause was the most probable in {percent(trials.right)}, "
        f"decided in {percent(trials.decided)}, wrongly in {percent(trials.wrong)}."
    )
