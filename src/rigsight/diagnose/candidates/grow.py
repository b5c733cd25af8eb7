"""Does a second effect explain what the best one leaves? Greedy growth from the best models, each pair on held-out records.

Every effect gets a first look beside the best model; only those that lower the cost clearly are fitted with care. Then each part
of the best pairs is fitted alone from there. What the growth cannot do without is found by the ranking: the pair competes with
its own parts.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for greedy forward selection of terms.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rigsight.diagnose.candidates.characterize import finished, followed, refine
from rigsight.diagnose.candidates.first_look import Look, look_at, widened
from rigsight.diagnose.places.search import search_places
from rigsight.diagnose.places.suspects import structures_of_lineup
from rigsight.diagnose.second_cause import OtherForms
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect
from rigsight.simulate import Structure, carried_over

MOST_EFFECTS = 2
"""Effects that a verdict can name together."""
_BEAM = 1.3
"""Singles are grown if their held-out error is within this factor of the best: the simplest, and the best that is unlike it."""
_TIE = 1.01
_WORTH_FOLLOWING = 0.85
"""Factor by which a second effect must lower the cost at a first look to be fitted with care."""
_MOST_FOLLOWED = 6
_NEAR_THE_BEST = 2.0
"""Pairs that cost at most this many times the best at a first look are fitted with care."""
_BOTH_WAYS = 6
"""Most promising pairs that are looked at from the fit of the second effect as well: a strong memory hides behind a first one."""
_MOST_FINISHED = 2
_MOST_PRUNED = 2
_MOST_STEPS = 4
"""Substeps of a first look at a pair beyond its parent's: enough for a lag of a fifth of a sample."""
_FINEST_STEPS = 4
"""Substeps up to which another parent than the plainest is grown from: a loop far stiffer than the records is no loop of the rig,
and each of its partners would take as fine steps. An assumption, made for the time that it saves."""
_NOTHING_LEFT = 1.03
"""Held-out error in units of the noise floor above which more is tried: another parent, effects that contain one of the pair's.

An assumption: floors are known to a few percent.
"""
_IN_ITS_PLACE = 1.5
"""Effects whose held-out error alone is within this factor of the first one's are tried in its place beside the second."""
_HALF = 0.5
"""Share of what the best single leaves above the floor that a second effect must close, as the first must of the whole gap.

An assumption: where the form of the first is not quite that of the rig, many a second one takes a little off the rest.
"""

Prepare = Callable[[Sequence[Structure]], None]


def grown(
    bench: Workbench,
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    at_floor: float,
    worthwhile: float,
    forms: OtherForms,
    prepare: Prepare | None = None,
) -> list[Scored]:
    """Return pairs of effects that close at least half of what the best single leaves, fitted and scored.

    Parameters
    ----------
    bench
        Records, scales and noise.
    singles
        Every effect alone, fitted and scored.
    effects
        Candidates for the second place.
    at_floor
        Held-out error in units of the noise floor at which nothing is left to explain.
    worthwhile
        Held-out error up to which an effect is believed to explain anything.
    forms
        Says which effects are worth trying beside another.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.

    Returns
    -------
    Pairs with the effect first that explains more by itself.
    """
    usable = sorted((m for m in singles if m.residuals and np.isfinite(m.excess)), key=lambda m: m.excess)
    if not usable or usable[0].excess <= at_floor:
        return []
    # Beside an effect that explains nothing a second one does what it does alone.
    explaining = [model for model in usable if model.excess <= worthwhile] or usable
    close = [model for model in explaining if model.excess <= _BEAM * usable[0].excess]
    # Of those that explain as much, the one with the fewest numbers leaves most for a second to explain; of those with as
    # many, the one that the catalogue has first is the plainer.
    best = min(close, key=lambda model: (model.n_free, model.excess))
    first = _plainest([model for model in close if model.n_free == best.n_free], best, effects)
    others = [model for model in close if model is not first and not _alike(first, model)]
    others = [model for model in others if max(model.fit.substeps) <= _FINEST_STEPS]
    allowed = usable[0].excess - _HALF * (usable[0].excess - 1.0)
    # An effect that was left out of the singles, as another says the same, may still be half of a pair.
    alone = {effect.name: np.inf for effect in effects} | {model.names[0]: model.excess for model in singles}
    pairs: list[Scored] = []
    parents = [(first, _NOTHING_LEFT)]
    if others:
        parents.append((_plainest(others, others[0], effects), _NOTHING_LEFT))
        # Fitted by itself, an effect may stand far off for what a second one does to it: one more where no pair competes.
        parents.append((min(others, key=lambda model: (model.n_free, model.excess)), allowed))
    tried: list[Scored] = []
    for parent, enough in parents:
        if parent not in tried and min((pair.excess for pair in pairs), default=np.inf) > enough:
            tried.append(parent)
            pairs += _grown_from(bench, parent, forms.partners(parent, effects), pairs, usable, prepare)
    best_pair = min(pairs, key=lambda pair: pair.excess, default=None)
    if best_pair is not None and best_pair.excess <= allowed:
        # What came second may be right and the first only its relative: another as good alone may do better in its place.
        for second in (model for model in usable if model not in tried):
            if second.effects[0] in best_pair.effects:
                (name,) = set(best_pair.names) - set(second.names)
                instead = [e for e in effects if alone[e.name] <= _IN_ITS_PLACE * alone[name]]
                pairs += _grown_from(bench, second, forms.partners(second, instead), pairs, usable, prepare)
    for _ in range(MOST_EFFECTS):
        best_pair = min(pairs, key=lambda pair: pair.excess, default=None)
        if best_pair is None or not _NOTHING_LEFT < best_pair.excess <= allowed:
            break
        pairs += _more_general(bench, best_pair, usable, effects, pairs, prepare)
    pairs.sort(key=lambda pair: pair.excess)
    # Of two that are one law, such as a late drive and a late sensor, the one that is finished alone would win.
    last = pairs[:_MOST_FINISHED][-1].excess if pairs else 0.0
    n_finished = sum(pair.excess <= _TIE * last for pair in pairs)
    pairs = [*(finished(bench, pair) for pair in pairs[:n_finished]), *pairs[n_finished:]]
    return [
        replace(pair, effects=tuple(sorted(pair.effects, key=lambda effect: alone[effect.name])))
        for pair in refine(bench, pairs)
        if pair.excess <= allowed
    ]


def _plainest(models: Sequence[Scored], like: Scored, effects: Sequence[Effect]) -> Scored:
    """Return of the models that explain as much as one of them that with the fewest numbers, the first in the catalogue."""
    order = {effect.name: place for place, effect in enumerate(effects)}
    tied = [model for model in models if model.excess <= _TIE * like.excess]
    return min(tied, key=lambda model: (model.n_free, order[model.names[0]]))


def pruned(bench: Workbench, singles: Sequence[Scored], pairs: Sequence[Scored]) -> list[Scored]:
    """Return the singles, refitted where they do better from where they stand in a pair than from where they were found.

    A second effect may do no more than lift a fit of the first over a ridge; without it the first then explains as much.

    Parameters
    ----------
    bench
        Records, scales and noise.
    singles
        Every effect alone, fitted and scored.
    pairs
        From `grown`.
    """
    better = {model.names: model for model in singles}
    for pair in sorted(pairs, key=lambda pair: pair.excess)[:_MOST_PRUNED]:
        for effect in pair.effects:
            known = better.get((effect.name,))
            if known is not None and known.excess <= _TIE * pair.excess:
                continue
            structure = bench.simplest((effect,)) if known is None else known.fit.structure
            free = tuple(bench.free_parameters(structure)) if known is None else known.fit.free
            values = {
                **(known or pair).fit.values,
                **dict(structure.fixed),
                **carried_over(pair.fit.values, pair.fit.structure, structure),
            }
            start = replace((known or pair).fit, values={name: values[name] for name in structure.names})
            alone = followed(bench, Look((effect,), structure, free, (start,), float("inf")), promising=True)
            # One that was left out of the singles, as another said the same, comes back only where it is all that is needed.
            if alone.excess <= (_TIE * pair.excess if known is None else known.excess / _TIE):
                better[alone.names] = alone
    return list(better.values())


def _grown_from(
    bench: Workbench,
    parent: Scored,
    effects: Sequence[Effect],
    known: Sequence[Scored],
    singles: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    open_ones = [
        effect
        for effect in bench.offered(effects)
        if effect not in parent.effects and not _known_pair(known, parent, effect)
    ]
    if prepare is not None:
        prepare(structures_of_lineup(bench.rig, open_ones, (*bench.modelled, *parent.effects)))
    partners = search_places(bench, parent, open_ones).effects
    return _pairs(bench, parent, partners, singles, prepare)


def _more_general(
    bench: Workbench,
    pair: Scored,
    singles: Sequence[Scored],
    effects: Sequence[Effect],
    known: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    """Return the pairs in which an effect that contains one of the pair's stands in its place, fitted from there.

    Beside another effect a simpler relative may lead at a first look, as it has fewer numbers to find.
    """
    alone = {model.names[0]: model for model in singles}
    swaps = []
    for member, other in (pair.effects, pair.effects[::-1]):
        if other.name in alone:
            swaps += [
                (other, child, member)
                for child in bench.offered(effects)
                if member.name in child.parents
                and child != other
                and not _known_pair(known, alone[other.name], child)
            ]
    if prepare is not None:
        prepare([bench.simplest((other, child)) for other, child, _ in swaps])

    def one(swap: tuple[Effect, Effect, Effect]) -> Scored:
        other, child, member = swap
        look = look_at(
            bench, (other, child), alone[other.name].fit, {member.name: pair.fit}, substeps=pair.fit.substeps
        )
        (wide,) = widened(bench, [look], substeps=pair.fit.substeps)
        return followed(bench, wide, promising=wide.cost <= pair.fit.cost, finish=False)

    return list(bench.threads.side_by_side(one, swaps))


def _alike(one: Scored, other: Scored) -> bool:
    """Return True if one is a special or limiting case of the other: what is missing beside them is the same."""
    parents = {name for model in (one, other) for effect in model.effects for name in effect.parents}
    return bool(parents & {*one.names, *other.names})


def _known_pair(pairs: Sequence[Scored], parent: Scored, effect: Effect) -> bool:
    return any(set(pair.names) == {*parent.names, effect.name} for pair in pairs)


def _pairs(
    bench: Workbench,
    parent: Scored,
    partners: Sequence[Effect],
    singles: Sequence[Scored],
    prepare: Prepare | None,
) -> list[Scored]:
    base = parent.fit
    if prepare is not None:
        prepare([bench.simplest((*parent.effects, effect)) for effect in partners])

    alone = {model.names[0]: model.fit for model in singles}

    def steps(effect: Effect) -> tuple[int, ...]:
        """Return substeps that serve both: a lag needs finer ones than its parent."""
        own = alone.get(effect.name)
        if own is None:
            return base.substeps
        return tuple(max(n, min(m, _MOST_STEPS)) for n, m in zip(base.substeps, own.substeps, strict=True))

    def one(effect: Effect) -> Look:
        return look_at(bench, (*parent.effects, effect), base, {}, substeps=steps(effect))

    looks = list(bench.threads.side_by_side(one, partners))
    near = min((look.nearest for look in looks), default=float("inf"))

    def wide(look: Look) -> list[Look]:
        return widened(bench, [look], substeps=steps(look.effects[-1]), lowest=near)

    found = list(bench.threads.side_by_side(wide, looks))
    looks = sorted(itertools.chain.from_iterable(found), key=_cost)[:_BOTH_WAYS]

    def other_way(found: Look) -> Look:
        second = found.effects[-1]
        if second.name not in alone:
            return found
        substeps = steps(second)
        turned = look_at(bench, (second, *parent.effects), alone[second.name], {}, substeps=substeps)
        (wider,) = widened(bench, [turned], substeps=substeps)
        return min(found, replace(wider, effects=found.effects), key=_cost)

    looks = list(bench.threads.side_by_side(other_way, looks))
    lowest = min((found.cost for found in looks), default=float("inf"))
    worth = min(_WORTH_FOLLOWING * base.cost, _NEAR_THE_BEST * lowest)
    promising = sorted((found for found in looks if found.cost <= worth), key=_cost)

    def follow(found: Look) -> Scored:
        return followed(bench, found, promising=True, finish=False)

    return list(bench.threads.side_by_side(follow, promising[:_MOST_FOLLOWED]))


def _cost(found: Look) -> float:
    return found.cost
