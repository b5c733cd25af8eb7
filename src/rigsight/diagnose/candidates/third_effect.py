"""Does a third effect explain what the best two leave?

Only where some push takes the larger part of that away, and more than another form of one of the two would.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.candidates.characterize import finished, followed, refine
from rigsight.diagnose.candidates.first_look import Look
from rigsight.diagnose.candidates.one_law import are_one_law
from rigsight.diagnose.candidates.one_more_effect import Prepare, is_among, with_one_more
from rigsight.diagnose.main_cause import LARGER_PART
from rigsight.diagnose.second_cause import OtherForms
from rigsight.diagnose.verdict import WORTHWHILE
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect
from rigsight.simulate import carried_over

IN_ITS_PLACE = 1.5
"""Effects whose held-out error alone is within this factor of that of another one are tried in its place."""
_MOST_FINISHED = 2


def with_a_third(
    bench: Workbench,
    singles: Sequence[Scored],
    pairs: Sequence[Scored],
    effects: Sequence[Effect],
    at_floor: float,
    forms: OtherForms,
    prepare: Prepare | None = None,
) -> list[Scored]:
    """Return models of three effects, grown from the best pair, fitted and scored.

    Parameters
    ----------
    bench
        Records, scales and noise.
    singles, pairs
        Fitted and scored.
    effects
        Candidates for the third place.
    at_floor
        Held-out error in units of the noise floor at which nothing is left to explain.
    forms
        Says what other forms of the two would explain.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """
    best = min(pairs, key=lambda pair: pair.excess, default=None)
    alone = min((model.excess for model in singles), default=np.inf)
    if best is None or best.excess <= at_floor or not best.excess * WORTHWHILE < alone:
        return []
    least = max(LARGER_PART, forms.share(best))
    found = with_one_more(bench, best, effects, [], singles, prepare, least_share=least)
    return _finished(bench, found)


def with_relatives(
    bench: Workbench,
    triples: Sequence[Scored],
    pairs: Sequence[Scored],
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    prepare: Prepare | None = None,
) -> tuple[list[Scored], list[Scored]]:
    """Return the triples with those in which a relative stands for an effect of the best one, and the pairs with their parts.

    Found beside an incomplete model, an effect may be only a relative of the right one, or more general than what is needed.

    Parameters
    ----------
    bench
        Records, scales and noise.
    triples
        Fitted and scored.
    pairs
        Fitted and scored; parts of the best triples that are missing are fitted too, so that each effect's share can be told.
    singles
        Every effect alone, fitted and scored.
    effects
        Candidates; those are tried that explain about as much by themselves as the one in whose place they come, and act where it
        does or are one law with it.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.
    """
    alone = {model.names[0]: model.excess for model in singles}

    def as_good(replaced: Effect, other: Effect) -> bool:
        near = alone.get(other.name, np.inf) <= IN_ITS_PLACE * alone.get(replaced.name, 0.0)
        at_its_place = bench.rig.acts_at(other) == bench.rig.acts_at(replaced)
        related = at_its_place or are_one_law((replaced, other), bench.rig)
        return near and related and other.name not in replaced.parents

    def plainer(replaced: Effect, other: Effect) -> bool:
        return other.name in replaced.parents

    found, known = list(triples), list(pairs)
    for is_tried in (as_good, plainer, as_good):
        best = min(found, key=lambda model: model.excess)
        known += _parts_of(bench, best, known)
        new: list[Scored] = []
        for replaced in best.effects:
            pair = next(p for p in known if set(p.names) == set(best.names) - {replaced.name})
            instead = [effect for effect in effects if is_tried(replaced, effect)]
            if instead and pair.residuals:
                new += with_one_more(bench, pair, instead, [*found, *new], singles, prepare)
        found += _finished(bench, new)
    known += _parts_of(bench, min(found, key=lambda model: model.excess), known)
    return found, known


def _finished(bench: Workbench, models: Sequence[Scored]) -> list[Scored]:
    ordered = sorted(models, key=lambda model: model.excess)
    best = [finished(bench, model) for model in ordered[:_MOST_FINISHED]]
    return refine(bench, [*best, *ordered[_MOST_FINISHED:]])


def _parts_of(bench: Workbench, triple: Scored, known: Sequence[Scored]) -> list[Scored]:
    """Return the pairs of effects of a triple that have not been fitted so far, fitted from where they stand in it."""

    def one(effects: tuple[Effect, ...]) -> Scored:
        structure = bench.simplest(effects)
        values = {**carried_over(triple.fit.values, triple.fit.structure, structure), **dict(structure.fixed)}
        start = replace(triple.fit, values=values)
        look = Look(effects, structure, tuple(bench.free_parameters(structure)), (start,), float("inf"))
        return followed(bench, look, promising=True, finish=False)

    missing = [
        two
        for two in itertools.combinations(triple.effects, 2)
        if not is_among(known, {effect.name for effect in two})
    ]
    return list(bench.threads.side_by_side(one, missing))
