"""Which effects can be told apart along measured motions: how much of what one adds to the equations another one imitates.

An effect pushes the equations along a motion. What numbers of the equations and a rival, at its best parameters, leave of this
push is what tells the two apart; where they leave nothing, no method can.

References
----------
R. Brun, P. Reichert and H. R. Künsch, Water Resour. Res. 37 (2001) 1015, for collinearity of influences as a measure of what data
can distinguish.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.inverse.effect_terms import EffectTerms
from rigsight.inverse.equation_fit import LAW_ERROR
from rigsight.inverse.regression import Regression
from rigsight.inverse.term import Term

Floats = NDArray[np.float64]

_LEAST = LAW_ERROR
"""Share of the RMS of a push that must be left of it: laws of real rigs err by as much."""
_MOST, _FEW = 0.8, 0.2
"""Shares of the parameter values of an effect for which its push must differ: for most of them, for few (conventions)."""
_RIDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Separability:
    """How far pushes of effects differ along motions.

    Attributes
    ----------
    effects
        The effects, at their places.
    visible
        Share of the parameter values of each effect at which its push is not one of the numbers of the equations, shape (n,).
    apart
        Share of the parameter values at which the effect of a row is visible and its push differs from that of the effect of a
        column at any parameters, shape (n, n); zero where it is never visible.
    """

    effects: tuple[Effect, ...]
    visible: Floats
    apart: Floats

    def is_visible(self, i: int) -> bool | None:
        """Return whether an effect shows beside the numbers of the equations for most of its values; None for some."""
        return _of_most(self.visible[i])

    def are_apart(self, i: int, j: int) -> bool | None:
        """Return whether two effects differ for most of their values; None where they do for some.

        Of two the one with fewer parameters is believed where it suffices, so the other one must differ; of equals both must.
        """
        more = self._n_fitted[i] - self._n_fitted[j]
        least = self.apart[i, j] if more > 0 else self.apart[j, i]
        if more == 0:
            least = min(self.apart[i, j], self.apart[j, i])
        return _of_most(least)

    @cached_property
    def _n_fitted(self) -> list[int]:
        return [sum(p.fitted for p in effect.parameters) for effect in self.effects]


class Pushes:
    """Pushes of effects along motions, of which any may be taken together.

    Parameters
    ----------
    terms_of
        Equations along the motions.
    effects
        Candidates at their places; those without a term are left out.
    """

    def __init__(self, terms_of: EffectTerms, effects: Sequence[Effect]) -> None:
        terms = [term for effect in effects for term in terms_of.of(effect)]
        named = {term.effect.name for term in terms}
        self.effects = tuple(effect for effect in effects if effect.name in named)
        regression = Regression(terms_of.fit, terms_of.values)
        self._own = regression.own
        self._places: list[list[int]] = []
        first = regression.n_columns
        for term in terms:
            self._places.append(list(range(first, first + len(term.columns[0]))))
            first += len(term.columns[0])
        if terms:
            regression = regression.with_columns([t.columns for t in terms], [t.is_given for t in terms])
        self._products = [part.T @ part for part in _of_motions(regression)]
        names = [effect.name for effect in self.effects]
        self._effect_of = np.array([names.index(term.effect.name) for term in terms], dtype=np.int64)
        # What a limit loses cannot be gained: a dead zone of negative size would be a saturation.
        self._one_sided = [
            term.is_given or (len(term.one_sided) == 1 and term.one_sided[0]) for term in terms
        ]
        pushes = [
            (own, place, coefficients)
            for own, term, place in zip(self._effect_of, terms, self._places, strict=True)
            for coefficients in _coefficients(term)
        ]
        self._pushed_by = np.array([own for own, *_ in pushes], dtype=np.int64)
        self._directions = np.zeros((regression.n_columns, len(pushes)))
        for number, (_, place, coefficients) in enumerate(pushes):
            self._directions[place, number] = coefficients * regression.size[place]

    def along(self, motions: Sequence[int]) -> Separability:
        """Return what tells the effects apart along these motions, by their numbers."""
        products = np.sum([self._products[motion] for motion in motions], axis=0)[:-1, :-1]
        own, n = self._own, len(self.effects)
        ridge = _RIDGE * np.trace(products) / max(len(products), 1)
        known = products[own]
        inner = known[:, own] + ridge * np.eye(len(own))
        beside = products - known.T @ np.linalg.solve(inner, known) if own else products
        pushed = beside @ self._directions
        whole = np.einsum("ij,ij->j", self._directions, products @ self._directions)
        left = np.maximum(np.einsum("ij,ij->j", self._directions, pushed), 0.0)
        shows = left > _LEAST**2 * whole
        unit = np.where(shows, left, 1.0)
        closest = np.ones((left.size, n))
        for j, place in enumerate(self._places):
            part, along = beside[np.ix_(place, place)] + ridge * np.eye(len(place)), pushed[place]
            explained = np.einsum("ij,ij->j", along, np.linalg.solve(part, along)) / unit
            if self._one_sided[j]:
                explained = np.where(along[0] > 0.0, explained, 0.0)
            effect = self._effect_of[j]
            closest[:, effect] = np.minimum(closest[:, effect], 1.0 - explained)
        differs = shows[:, None] & (closest > _LEAST**2)
        of_effect = [self._pushed_by == i for i in range(n)]
        n_shown = np.array([max(np.count_nonzero(shows[own]), 1) for own in of_effect])
        return Separability(
            self.effects,
            np.array([np.mean(shows[own]) for own in of_effect]),
            np.array([np.sum(differs[own], axis=0) for own in of_effect]).reshape(n, n) / n_shown[:, None],
        )


def _of_most(share: float) -> bool | None:
    return True if share >= _MOST else False if share <= _FEW else None


def _of_motions(regression: Regression) -> Iterator[Floats]:
    """Yield the rows of the regression along each motion."""
    ends = np.cumsum([n_equations * n for n_equations, n in regression.shapes])
    yield from np.split(regression.matrix, ends[:-1])


def _coefficients(term: Term) -> Iterator[Floats]:
    """Yield coefficients of a term's columns: equal ones, and each half of the others where the effect allows it."""
    for values in itertools.product((1.0, 0.5), repeat=len(term.columns[0])):
        if max(values) == 1.0 and term.allows(np.array(values)):
            yield np.array(values)
