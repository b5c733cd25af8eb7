"""The smallest size at which each effect would have been named: it is added to the force along the measured motion.

What an effect of a given size would add to the equations is added to what they need in the records as they are, with all their
noise and law errors, and the families are selected again. The effect counts as named if its family at its place is the first
that is taken beside those that the records show already, in four of five resamplings of the stretches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.effects import Effect, Family, kind_of, placed_dimension
from rigsight.inverse.effect_terms import EffectTerms
from rigsight.inverse.propose import selection_of
from rigsight.inverse.regression import STRETCHES
from rigsight.inverse.selection import Key, Selection
from rigsight.units import characteristic_value

NAMED_IN = 0.8
"""Share of the resamplings in which an effect must be named."""
_RESAMPLINGS = 20
_SIZES = np.geomspace(1e-4, 10.0, 11)
"""Sizes that are tried first, relative to the start value of the effect's search."""
_STEPS = 4
"""Sizes between two of them."""


@dataclass(frozen=True)
class NamedSize:
    """The smallest size of an effect at a place that would have been named.

    Attributes
    ----------
    effect, family, where
        Name of the effect, its family and its place.
    parameters
        Its parameters at that size with their units, the one that measures the size first; empty where there is none.
    reason
        Why there is none; empty where there is one.
    """

    effect: str
    family: Family
    where: str
    parameters: Mapping[str, tuple[float, str]]
    reason: str = ""


def named_sizes(
    terms_of: EffectTerms, effects: Sequence[Effect], seed: int, say: Callable[[str], None]
) -> list[NamedSize]:
    """Return for each effect the smallest size that would have been named in `NAMED_IN` of the resamplings.

    Parameters
    ----------
    terms_of
        Equations along the measured motion.
    effects
        Candidates at their places.
    seed
        Of the resampling.
    say
        Called with the name of each effect that is done.
    """
    rig = terms_of.fit.rig
    selection = selection_of(terms_of, effects)
    if selection is None:
        return [_none(terms_of, effect, _NOT_ASKED) for effect in effects]
    # A tone is sought where the residual has a line: one that is hidden elsewhere would not be asked for. The input that a motion
    # would need beyond a limit of a drive was never logged.
    judged = {
        term.effect.name
        for term in selection.terms
        if term.effect.pulsation is None and not (term.is_given and term.inner)
    }
    known = selection.selected(rig)
    found = []
    for effect in effects:
        if (effect.family, rig.where(effect)) in [key for key, _, _ in known]:
            found.append(_none(terms_of, effect, "These records show this family there already."))
        elif not terms_of.can_show(effect):
            found.append(_none(terms_of, effect, _HIDDEN))
        elif effect.name not in judged:
            found.append(_none(terms_of, effect, _NOT_ASKED))
        else:
            found.append(_smallest(terms_of, selection, known, effect, seed))
        say(effect.name)
    return found


_HIDDEN = (
    "These records cannot show it at any size: a delay of a free motion, a force over a position that nothing shows, or a "
    "difference between directions of a motion in one."
)
_NOT_ASKED = (
    "Not judged along the motion: only fits of the simulation find resonances, tones, and errors of sensors of which there are "
    "more than the motion needs; what a drive would need beyond a limit was never logged."
)


def _none(terms_of: EffectTerms, effect: Effect, reason: str) -> NamedSize:
    return NamedSize(kind_of(effect.name), effect.family, terms_of.fit.rig.where(effect), {}, reason)


def _smallest(
    terms_of: EffectTerms,
    selection: Selection,
    known: Sequence[tuple[Key, int, float]],
    effect: Effect,
    seed: int,
) -> NamedSize:
    rig = terms_of.fit.rig
    key = (effect.family, rig.where(effect))

    def named(size: float) -> Iterator[bool]:
        """Yield whether an effect of a size is named: in the records as they are, then in resamplings."""
        rows = terms_of.acting(effect, _own_values(terms_of, effect, size))
        if rows is None:
            yield from (False,) * (1 + _RESAMPLINGS)
            return
        added = selection.regression.with_added(rows)
        yield selection.with_regression(added).names(rig, key, known)
        rng = np.random.default_rng(seed)
        for _ in range(_RESAMPLINGS):
            counts = rng.multinomial(STRETCHES, np.full(STRETCHES, 1.0 / STRETCHES))
            yield selection.with_regression(added.resampled(counts)).names(rig, key, known)

    as_they_are = [next(named(float(size))) for size in _SIZES]
    first = next((i for i in range(_SIZES.size) if all(as_they_are[i : i + 2])), None)
    if first is None:
        return _none(terms_of, effect, f"Not named at any size up to {_SIZES[-1]:g} times the usual one.")
    for size in _SIZES[first] * np.geomspace(_SIZES[0] / _SIZES[1], _SIZES[1] / _SIZES[0], 2 * _STEPS + 1):
        draws = named(float(size))
        if next(draws) and _is_mostly(draws):
            return _at(terms_of, effect, float(size))
    return _none(terms_of, effect, f"Named in less than {NAMED_IN:.0%} of the resamplings at any size tried.")


def _is_mostly(draws: Iterator[bool]) -> bool:
    """Return whether `NAMED_IN` of the resamplings are true; no more are drawn than decide it."""
    missed = 0
    for n, named in enumerate(draws, 1):
        missed += not named
        if missed > (1.0 - NAMED_IN) * _RESAMPLINGS:
            return False
        if n - missed >= NAMED_IN * _RESAMPLINGS:
            return True
    return False


def _at(terms_of: EffectTerms, effect: Effect, size: float) -> NamedSize:
    rig = terms_of.fit.rig
    own = _own_values(terms_of, effect, size)
    grown = [p for p in effect.parameters if p.fitted and p.null is not None]
    others = [p for p in effect.parameters if p not in grown]
    parameters = {p.name: (own[p.name], rig.with_unit(p, effect.at).unit) for p in (*grown, *others)}
    return NamedSize(kind_of(effect.name), effect.family, rig.where(effect), parameters)


def _own_values(terms_of: EffectTerms, effect: Effect, size: float) -> dict[str, float]:
    """Return the parameters of an effect of a size relative to its first start."""
    values = {}
    for p in effect.parameters:
        usual = characteristic_value(placed_dimension(effect, p.dimension), terms_of.scales)
        start = p.starts[0] * usual if p.fitted else p.held_at(usual)
        values[p.name] = p.grown(start, size) if p.fitted else start
    return values
