"""Which effects can the records tell apart, which another motion or no record of these sensors, and what is left open?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from rigsight.campaign import Campaign
from rigsight.effects import Effect, Family
from rigsight.errors import SimulationError
from rigsight.inverse.effect_terms import EffectTerms
from rigsight.inverse.propose import along_motion
from rigsight.inverse.separability import Pushes
from rigsight.records import Record, is_constant
from rigsight.simulate import compose, record_values, simulate

Told = Literal["apart", "by size", "other motion", "alike"]
"""Whether two effects can be told apart: here, for some sizes, by another motion; or they push alike to what laws err."""
Visible = Literal["yes", "at some sizes", "no"]
"""Whether an effect shows beside the parameters: for most of its parameter values, for some, or for none."""
_VISIBLE: Mapping[bool | None, Visible] = {True: "yes", None: "at some sizes", False: "no"}
_OTHER = 3.0
"""Factor of the amplitude and of the speed of other motions."""
_LONGEST = 1500
"""Samples of each other motion."""
_OPEN: Sequence[Told] = ("other motion", "by size", "alike")
"""Answers of pairs that are left open; the first of them are those that another record is most likely to tell apart."""


@dataclass(frozen=True)
class EffectMatrix:
    """Pairs of effects, in the order of the catalogue."""

    # Name, family and place of each effect.
    effects: tuple[str, ...] = ()
    families: tuple[Family, ...] = ()
    where: tuple[str, ...] = ()
    visible: tuple[Visible, ...] = ()  # whether each effect shows beside the parameters in these records
    told: tuple[tuple[Told, ...], ...] = ()  # whether the effects of a row and a column can be told apart
    # Of pairs that another motion tells apart, the first motion that does.
    motions: Mapping[tuple[int, int], str] = field(default_factory=dict)
    not_judged: tuple[str, ...] = ()  # names of the effects that only fits of the simulation find
    hidden: tuple[str, ...] = ()  # names of the effects that these records cannot show at any size
    reason: str = ""  # why there is no matrix; empty where there is one

    @property
    def pairs(self) -> list[tuple[int, int]]:
        """Pairs of effects, each once."""
        return [(i, j) for i in range(len(self.effects)) for j in range(i)]

    def share(self, told: Told) -> float:
        """Return the share of the pairs with an answer."""
        found = [self.told[i][j] == told for i, j in self.pairs]
        return float(np.mean(found)) if found else 0.0


def effect_matrix(
    campaign: Campaign, records: Sequence[Record], values: Mapping[str, float], effects: Sequence[Effect]
) -> EffectMatrix:
    """Return which effects at their places can be told apart by short records, with values of the rig and of modelled effects."""
    terms_of = along_motion(replace(campaign, records=tuple(records)), values)
    if terms_of is None:
        return EffectMatrix(
            reason="The sensors do not show the whole motion, or a modelled effect acts at a drive or a sensor. Effects cannot "
            "be compared along the motion."
        )
    rig, pushes = campaign.rig, Pushes(terms_of, effects)
    judged, here = pushes.effects, pushes.along(range(len(terms_of.fit.motions)))
    told: list[list[Told]] = [["apart"] * len(judged) for _ in judged]
    alike = [(i, j) for i in range(len(judged)) for j in range(i) if not here.are_apart(i, j)]
    motions = _told_by_other_motions(
        terms_of, _other_motions(campaign, records, terms_of.values), judged, alike
    )
    for i, j in alike:
        answer: Told = "by size" if here.are_apart(i, j) is None else "alike"
        told[i][j] = told[j][i] = "other motion" if (i, j) in motions else answer
    named = {effect.name for effect in judged}
    return EffectMatrix(
        tuple(effect.name for effect in judged),
        tuple(effect.family for effect in judged),
        tuple(rig.where(effect) for effect in judged),
        tuple(_VISIBLE[here.is_visible(i)] for i in range(len(judged))),
        tuple(map(tuple, told)),
        motions,
        tuple(e.name for e in effects if e.name not in named and terms_of.can_show(e)),
        tuple(e.name for e in effects if not terms_of.can_show(e)),
    )


def _told_by_other_motions(
    terms_of: EffectTerms,
    others: Sequence[tuple[str, Record]],
    judged: Sequence[Effect],
    pairs: Sequence[tuple[int, int]],
) -> dict[tuple[int, int], str]:
    """Return the first other motion that tells a pair of effects apart, of those pairs that one does."""
    numbers = sorted({i for pair in pairs for i in pair})
    if not numbers or not others:
        return {}
    pushes = Pushes(terms_of.along_records([record for _, record in others]), [judged[i] for i in numbers])
    names = [effect.name for effect in judged]
    # Along another motion an effect may not be finite.
    place = {names.index(effect.name): k for k, effect in enumerate(pushes.effects)}
    along = {what: pushes.along([k]) for k, (what, _) in enumerate(others)}
    along["all of these"] = pushes.along(range(len(others)))
    found: dict[tuple[int, int], str] = {}
    for i, j in (pair for pair in pairs if place.keys() >= set(pair)):
        by = next((what for what, own in along.items() if own.are_apart(place[i], place[j])), None)
        if by is not None:
            found[i, j] = by
    return found


def _other_motions(
    campaign: Campaign, records: Sequence[Record], values: Mapping[str, float]
) -> list[tuple[str, Record]]:
    """Return the liveliest record simulated with other amplitudes, at other speeds, and about rest."""
    rig, structure = campaign.rig, compose(campaign.rig, campaign.modelled)
    sensor = rig.outputs[0].name
    liveliest = max(records, key=lambda r: float(np.var(r[sensor])) if sensor in r else 0.0)
    record = liveliest.slice(0, _LONGEST)
    inputs = [signal.name for signal in rig.inputs]
    mean = {name: float(np.mean(record[name])) for name in inputs}

    def scaled(factor: float, around: float = 1.0) -> dict[str, np.ndarray]:
        return {name: around * mean[name] + factor * (record[name] - mean[name]) for name in inputs}

    both_ways = record.with_signals(**scaled(_OTHER, around=0.0))
    # Where an input has one sign only, three times its amplitude reverses it as well.
    has_one_sign = any(float(np.min(record[n]) * np.max(record[n])) >= 0.0 for n in inputs)
    asked = ({"a motion in both directions": both_ways} if has_one_sign else {}) | {
        "a larger amplitude": record.with_signals(**scaled(_OTHER)),
        "a smaller amplitude": record.with_signals(**scaled(1.0 / _OTHER)),
        "a faster motion": replace(record, dt=record.dt / _OTHER),
    }
    found = []
    for what, moved in asked.items():
        try:
            run = simulate(structure, record_values(structure, values, moved), moved)
        except SimulationError:
            continue
        # Where no input moves the rig, it rests.
        if not all(is_constant(run[signal.name]) for signal in rig.outputs):
            found.append((what, run))
    return found


@dataclass(frozen=True)
class Holes:
    """Effects of different families or places that records leave open together."""

    effects: tuple[str, ...]  # names, the one with the most open pairs first; empty where nothing is open
    # Whether one of them does not show beside the parameters at some or all sizes, so that no effect is their rival, too.
    hidden: bool
    others: tuple[str, ...]  # names of further effects that are open


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
