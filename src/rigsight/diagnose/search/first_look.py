"""From which starts is a candidate worth a careful fit to all records? Decided by short first fits from all its starts.

From every start a candidate is fitted to the most excited stretches of the records: first in short pieces with their own initial
states, which keeps an inaccurate model in phase with the motion, then in one piece. Starts are compared only after the second
fit: in pieces the right one may be the worst, because sliders that slip one sample too early or late trap the fit in a local
minimum that depends on rounding. From the best of these the candidate is fitted roughly to the whole records.

References
----------
H. G. Bock, in *Modelling of Chemical Reaction Systems* (Springer 1981) 102, for fits in pieces (multiple shooting, here without
continuity between the pieces).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from rigsight.diagnose.fit_context import FitContext
from rigsight.diagnose.policy import SEARCH
from rigsight.diagnose.search.starts import start_values
from rigsight.effects import Effect
from rigsight.identify import FitResult
from rigsight.identify.start.declared_starts import with_own_values
from rigsight.records.record import Floats
from rigsight.simulate import Structure

_LOOK_TOLERANCE = 1e-3
LOOK_ACCURACY = 1e-3


@dataclass(frozen=True)
class FirstLook:
    """First fits of a candidate to part of the records or roughly to all, best first, those that ended at the same place once."""

    # What was fitted.
    effects: tuple[Effect, ...]
    structure: Structure
    free: tuple[str, ...]
    fits: tuple[FitResult, ...]  # what was reached
    nearest: float  # mean squared error reached in the most excited stretches

    @property
    def newest(self) -> str:
        """Name of the effect that was added last."""
        return self.effects[-1].name

    @property
    def cost(self) -> float:
        """Lowest cost that was reached."""
        return self.fits[0].cost


def look_at(
    context: FitContext,
    effects: tuple[Effect, ...],
    base: FitResult,
    parents: Mapping[str, FitResult],
    further: Sequence[Mapping[str, float]] = (),
    hold: frozenset[str] = frozenset(),
    substeps: Sequence[int] | None = None,
    are_enough: bool = False,
    numbers: Mapping[str, float] = MappingProxyType({}),
) -> FirstLook:
    """Fit a set of effects to the most excited stretches of the records, from all starts of the last effect."""
    # `further` are more values of its own parameters, with `numbers` of the equations beside them; where they `are_enough`, its
    # declared starts are left out.
    structure = context.simplest(effects, base.structure)
    known = context.constant_forces_beside(structure.effects)
    moved = {*context.free_parameters(structure), *base.free} - {*hold, *known}
    free = tuple(name for name in structure.names if name in moved)
    starts = list(start_values(context, structure, effects[-1], base, parents))
    # Readings without their sign lead a fit of the equations alone to the numbers of another motion.
    origin = base
    if context.given and (context.leaves_numbers_open(base) or effects[-1].loses_sign):
        origin = replace(base, values={**base.values, **context.given})
        starts += start_values(context, structure, effects[-1], origin, {})
    beside = {name: value for name, value in numbers.items() if name in free}
    own_starts = [
        {**starts[0], **with_own_values(structure, effects[-1], origin, own), **beside} for own in further
    ]
    starts = own_starts if are_enough and own_starts else [*starts, *own_starts]
    starts = [{**start, **known} for start in starts]
    nearest = _looked(context, structure, free, starts, substeps)
    if not np.isfinite(nearest[0].cost) and context.start:
        unbent = replace(base, values={**base.values, **context.start})
        starts = [{**start, **known} for start in start_values(context, structure, effects[-1], unbent, {})]
        nearest = _looked(context, structure, free, starts, substeps)
    return FirstLook(effects, structure, free, nearest, mean_square(nearest[0]))


def started_from(
    context: FitContext,
    effects: tuple[Effect, ...],
    structure: Structure,
    starts: Sequence[Mapping[str, float]],
) -> FirstLook:
    """Fit a set of effects to the most excited stretches of the records from given starts."""
    free = tuple(context.free_parameters(structure))
    fits = _looked(context, structure, free, starts)
    return FirstLook(effects, structure, free, fits, mean_square(fits[0]))


def _looked(
    context: FitContext,
    structure: Structure,
    free: tuple[str, ...],
    starts: Sequence[Mapping[str, float]],
    substeps: Sequence[int] | None = None,
) -> tuple[FitResult, ...]:
    """Fit to the most excited stretches: in pieces from every start, then in one piece from the best results."""
    fit = context.problem(structure, context.look, LOOK_ACCURACY)
    stretches = context.look_in_pieces
    in_pieces = context.problem(structure, [piece for parts in stretches for piece in parts], LOOK_ACCURACY)
    of_pieces = None
    if substeps is not None:
        of_pieces = [n for n, parts in zip(substeps, stretches, strict=True) for _ in parts]

    def tried(start: Mapping[str, float], states: Sequence[Floats] | None, most: int) -> FitResult:
        return in_pieces.fit(start, free, states, most, _LOOK_TOLERANCE, False, of_pieces)

    if len(starts) > SEARCH.most_starts:
        glimpses = sorted(
            (tried(start, None, SEARCH.glimpse_evaluations) for start in starts), key=lambda f: f.cost
        )
        at_length = [
            tried(g.values, g.initial_states, SEARCH.look_evaluations)
            for g in glimpses[: SEARCH.lengthy_starts]
        ]
        first = [*at_length, *glimpses[SEARCH.lengthy_starts :]]
    else:
        first = [tried(start, None, SEARCH.look_evaluations) for start in starts]
    near = [
        fit.fit(found.values, free, None, SEARCH.look_evaluations, _LOOK_TOLERANCE, False, substeps)
        for found in _apart(first)
    ]
    return _distinct(near)


def widened(
    context: FitContext,
    looks: Sequence[FirstLook],
    substeps: Sequence[int] | None = None,
    lowest: float = float("inf"),
) -> list[FirstLook]:
    """Fit the first looks that came near the best one in the most excited stretches roughly to whole records; drop the others."""
    lowest = min([lowest, *(look.nearest for look in looks)])

    def one(look: FirstLook) -> FirstLook:
        return replace(look, fits=_on_whole_records(context, look.structure, look.free, look.fits, substeps))

    near = [look for look in looks if look.nearest <= SEARCH.near * lowest]
    return list(context.threads.side_by_side(one, near))


def examined_again(
    context: FitContext, settled: FitResult, starts: Sequence[Mapping[str, float]]
) -> tuple[FitResult, ...]:
    """Fit from other starts than those of a candidate: to the most excited stretches, then roughly to all records."""
    near = context.problem(settled.structure, context.look, LOOK_ACCURACY)
    looks = [
        near.fit(start, settled.free, None, SEARCH.look_evaluations, _LOOK_TOLERANCE, False)
        for start in starts
    ]
    best = sorted(looks, key=lambda fit: fit.cost)[: SEARCH.most_starts]
    return _on_whole_records(context, settled.structure, settled.free, best)


def _on_whole_records(
    context: FitContext,
    structure: Structure,
    free: tuple[str, ...],
    fits: Sequence[FitResult],
    substeps: Sequence[int] | None = None,
) -> tuple[FitResult, ...]:
    whole = context.problem(structure, context.estimation, LOOK_ACCURACY)

    def one(near: FitResult, steps: Sequence[int] | None) -> FitResult:
        found = whole.fit(near.values, free, None, SEARCH.wide_evaluations, _LOOK_TOLERANCE, False, steps)
        # Steps that served another model may be too long for a lag of a fraction of a sample.
        return found if steps is None or np.isfinite(found.cost) else one(near, None)

    return _distinct([one(near, substeps) for near in fits])


def mean_square(fit: FitResult) -> float:
    """Return the mean squared residual of a fit, in units of the noise floor squared."""
    return fit.cost / fit.n_samples


def _apart(fits: Sequence[FitResult]) -> list[FitResult]:
    """Return the fits, best first, those that ended at the same place once."""
    kept: list[FitResult] = []
    for fit in sorted(fits, key=lambda result: result.cost):
        if not any(_at_one_place(fit, other) for other in kept):
            kept.append(fit)
    return kept


def _distinct(fits: Sequence[FitResult]) -> tuple[FitResult, ...]:
    """Return the best fit, and the next one that ended elsewhere if its cost is nearly that of the best."""
    best, *others = _apart(fits)
    return (best, *[other for other in others if other.cost <= SEARCH.alike_starts * best.cost][:1])


def _at_one_place(one: FitResult, other: FitResult) -> bool:
    ours, theirs = (np.array([fit.values[name] for name in fit.free]) for fit in (one, other))
    return bool(np.allclose(ours, theirs, rtol=0.05, atol=1e-12))
