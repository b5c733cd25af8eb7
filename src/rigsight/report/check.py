"""What the records of a campaign can show as one self-contained HTML page without a script."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from rigsight.check import Check, Told, Visible
from rigsight.check.effect_matrix import EffectMatrix
from rigsight.effects import kind_of
from rigsight.report.labels import effect_label, listed, place_label
from rigsight.report.page import rendered

TOLD_WORDS: Mapping[Told, str] = {
    "apart": "told apart by these records",
    "by size": "depends on their size",
    "other motion": "only by another motion",
    "alike": "differ by less than 5 %, the usual error of a law",
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
        n_determined=sum(p.status in ("determined", "weak") for p in found.parameters),
        rivals=list(rivals(found.matrix)),
        forms=list(forms(found.matrix)),
        heads=[short_label(found.matrix, i) for i in range(len(found.matrix.effects))],
        not_judged=effect_names(found.matrix.not_judged),
        hidden=effect_names(found.matrix.hidden),
        headline=check_headline(found),
        signs=_SIGNS,
        told_words=TOLD_WORDS,
        classes={told: told.replace(" ", "-") for told in TOLD_WORDS},
    )


def effect_names(effects: Iterable[str]) -> list[str]:
    """Return the names of effects without their places, each once."""
    return sorted({effect_label(kind_of(effect)) for effect in effects})


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
