"""Does a second effect explain what the best one leaves? Greedy growth from the best models, each pair on held-out records.

Every effect gets a first look beside the best model; only those that lower the cost clearly are fitted to all records. What
the growth cannot do without is found by the ranking: the pair competes with its own parts.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for greedy forward selection of terms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from joblib import Parallel, delayed

from rigsight.diagnose.characterize import Look, followed, look_at, refine
from rigsight.diagnose.workbench import Scored, Workbench
from rigsight.effects import Effect
from rigsight.identify import FitResult, GreyBoxFit
from rigsight.simulate import Structure

MOST_EFFECTS = 2
"""Effects that a verdict can name together."""
_BEAM = 1.15
"""A second single is grown too if its held-out error is within this factor of the best."""
_WORTH_FOLLOWING = 0.85
"""Factor by which a second effect must lower the cost of a first look to be fitted to all records."""
_MOST_FOLLOWED = 4
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
    n_jobs: int = 1,
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
    n_jobs
        Candidates fitted at the same time.
    prepare
        Called with the structures that are about to be looked at, to compile them side by side.

    Returns
    -------
    Pairs with the effect first that explains more by itself.
    """
    usable = sorted((m for m in singles if m.residuals and np.isfinite(m.excess)), key=lambda m: m.excess)
    if not usable or usable[0].excess <= at_floor:
        return []
    beam = usable[:1]
    if len(usable) > 1 and usable[1].excess <= _BEAM * usable[0].excess and not _alike(usable[0], usable[1]):
        beam.append(usable[1])
    pairs: list[Scored] = []
    for parent in beam:
        partners = [
            effect
            for effect in bench.offered(effects)
            if effect not in parent.effects and not _known_pair(pairs, parent, effect)
        ]
        pairs += _pairs(bench, parent, partners, n_jobs, prepare)
    allowed = usable[0].excess - _HALF * (usable[0].excess - 1.0)
    alone = {model.names[0]: model.excess for model in singles}
    return [
        replace(pair, effects=tuple(sorted(pair.effects, key=lambda effect: alone[effect.name])))
        for pair in refine(bench, pairs, n_jobs)
        if pair.excess <= allowed
    ]


def _alike(one: Scored, other: Scored) -> bool:
    """Return True if one is a special or limiting case of the other: what is missing beside them is the same."""
    parents = {name for model in (one, other) for effect in model.effects for name in effect.parents}
    return bool(parents & {*one.names, *other.names})


def _known_pair(pairs: Sequence[Scored], parent: Scored, effect: Effect) -> bool:
    return any(set(pair.names) == {*parent.names, effect.name} for pair in pairs)


def _pairs(
    bench: Workbench, parent: Scored, partners: Sequence[Effect], n_jobs: int, prepare: Prepare | None
) -> list[Scored]:
    base = _settled(bench, parent)
    if prepare is not None:
        prepare([_structure(bench, (*parent.effects, effect)) for effect in partners])

    def one(effect: Effect) -> Look:
        return look_at(bench, (*parent.effects, effect), base, {}, substeps=base.substeps)

    looks = list(Parallel(n_jobs=n_jobs, prefer="threads")(delayed(one)(effect) for effect in partners))
    promising = sorted((found for found in looks if found.cost <= _WORTH_FOLLOWING * base.cost), key=_cost)

    def follow(found: Look) -> Scored:
        return followed(bench, found, promising=True)

    return list(
        Parallel(n_jobs=n_jobs, prefer="threads")(
            delayed(follow)(found) for found in promising[:_MOST_FOLLOWED]
        )
    )


def _cost(found: Look) -> float:
    return found.cost


def _structure(bench: Workbench, effects: tuple[Effect, ...]) -> Structure:
    special = {name: value for effect in effects for name, value in effect.special_cases.items()}
    return bench.composed(effects, special)


def _settled(bench: Workbench, parent: Scored) -> FitResult:
    """Fit the parent to the stretches that are looked at, so that both costs are of the same records."""
    fit = GreyBoxFit(parent.fit.structure, bench.look, bench.scales, bench.noise)
    return fit.fit(parent.fit.values, parent.fit.free, max_evaluations=30, tolerance=1e-3, finish=False)
