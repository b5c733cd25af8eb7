"""Which effects should a further record show or tell apart? A few of those that the matrix leaves open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rigsight.check.effect_matrix import EffectMatrix, Told

_OPEN: Sequence[Told] = ("other motion", "by size", "alike")
"""Answers of pairs that are left open; the first of them are those that another record is most likely to tell apart."""


@dataclass(frozen=True)
class Holes:
    """Effects of different families or places that records leave open together.

    Attributes
    ----------
    effects
        Their names, the one with the most open pairs first; empty where nothing is open.
    hidden
        Whether one of them does not show beside the parameters at some or all sizes, so that no effect is their rival, too.
    others
        Names of further effects that are open.
    """

    effects: tuple[str, ...]
    hidden: bool
    others: tuple[str, ...]


def holes_of(matrix: EffectMatrix, most: int) -> Holes:
    """Return a few effects that a further record should show or tell apart, which have at most so many rivals together."""
    families = list(zip(matrix.families, matrix.where, strict=True))
    everyone = range(len(families))
    hidden = [answer != "yes" for answer in matrix.visible]
    pairs = {
        (i, j): _OPEN.index(matrix.told[i][j])
        for i in everyone
        for j in everyone
        if families[i] != families[j] and matrix.told[i][j] in _OPEN
    }
    numbers = [
        tuple(sum(pairs.get((i, j)) == answer for j in everyone) for answer in range(len(_OPEN)))
        for i in everyone
    ]
    left = [i for i in everyone if hidden[i] or any(numbers[i])]
    if not left:
        return Holes((), False, ())
    first = max(left, key=lambda i: numbers[i])
    partners = [i for i in left if (first, i) in pairs or (hidden[first] and hidden[i])]
    partners.sort(key=lambda i: pairs.get((first, i), len(_OPEN)))
    chosen = [first]
    for i in partners:
        with_no_effect = any(hidden[k] for k in (*chosen, i))
        # One form of each family.
        if families[i] not in [families[k] for k in chosen] and len(chosen) + with_no_effect < most:
            chosen.append(i)
    others = [i for i in left if i not in chosen]
    names, further = (tuple(matrix.effects[i] for i in those) for those in (chosen, others))
    return Holes(names, any(hidden[i] for i in chosen), further)
