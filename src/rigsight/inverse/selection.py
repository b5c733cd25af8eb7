"""Which families explain a residual along the measured motion: greedy selection, judged on stretches left out.

References
----------
S. A. Billings, *Nonlinear System Identification* (Wiley 2013), for greedy forward selection of terms.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from rigsight.effects import Effect, Family
from rigsight.inverse.equation_fit import LAW_ERROR, EquationFit
from rigsight.inverse.measured_motion import WIDER
from rigsight.inverse.proposal import NumbersBeside, Proposal, ProposedCause, ProposedForm, ProposedStart
from rigsight.inverse.regression import STRETCHES, Regression
from rigsight.inverse.term import Term
from rigsight.rigs import Rig, evaluated
from rigsight.rigs.rig import joint_of

Floats = NDArray[np.float64]
Key = tuple[Family, str]
"""A family and the place at which it acts."""

_MOST_CAUSES = 5
"""Families that are taken at most; a robot has three to five causes at once."""
WORTH = 0.03
"""Least share of the residual that a further family must remove from stretches that it was not fitted to."""
_SIGNIFICANCE = 0.01
_DRAWS, _LIMITS = 100, (0.025, 0.975)
"""Resamplings of the stretches for the interval of a share, and its limits."""
_SHARES = (0.02, 0.98)
"""Limits of the share of the stiffness that a loop keeps: at 1 it would vanish."""
_DIGITS = 9
"""Digits of values from which fits start: further ones are rounding, on which fits of sticking joints would depend."""
_NEAR = 0.5
"""Share of what the best effect alone removes from which on a finer grid may make another one the best (a convention)."""


class Selection:
    """Greedy selection of families by the residual of held-out stretches."""

    def __init__(
        self,
        fit: EquationFit,
        values: Mapping[str, float],
        terms: Sequence[Term],
        noise: Floats | None = None,
    ) -> None:
        self.fit, self.values, self.terms = fit, values, list[Term]()
        self.places: list[list[int]] = []
        self.regression = Regression(fit, values, noise)
        # What each term leaves beside chosen columns, None where it cannot: further terms change nothing of it.
        self._known: dict[tuple[int, ...], dict[int, float | None]] = {}
        # Limit of the largest share of the squares that one of so many columns explains (Bonferroni): the share that a column
        # explains by chance has a beta distribution. What laws leave moves with the motion: in its band lie fewer rows than in
        # that of the forces. The numbers of the equations have taken their part of them.
        independent = max(self.regression.n_rows / WIDER - len(fit.free), 2.0)
        self.by_chance = 1.0 - (_SIGNIFICANCE / len(terms)) ** (2.0 / (independent - 1.0))
        # Nothing tells a given force from masses that shrink, or from a gain that grows.
        left_out = bool(fit.gains) or not self.regression.predicts_accelerations
        kept = [term for term in terms if not (term.is_given and left_out)]
        of_gain = terms if fit.gains else kept
        self.undecided = frozenset(t.effect.name for t in of_gain) - {t.effect.name for t in kept}
        self._add(kept)

    def _add(self, terms: Sequence[Term]) -> None:
        ends = np.cumsum([self.regression.n_columns, *(len(term.columns[0]) for term in terms)])
        self.terms, self.places = (
            [*self.terms, *terms],
            [*self.places, *(list(range(a, b)) for a, b in pairwise(ends))],
        )
        self.regression = self.regression.with_columns(
            [term.columns for term in terms], [term.is_given for term in terms]
        )

    def with_terms(self, terms: Sequence[Term]) -> Selection:
        """Return the selection among further terms, too. Near ones of the grid add nothing to what chance explains."""
        wider = copy(self)
        if terms:
            wider._add(terms)
        return wider

    def with_regression(self, regression: Regression) -> Selection:
        """Return the selection of the same terms by a regression on changed records."""
        changed = copy(self)
        changed.regression, changed._known = regression, {}
        return changed

    def leading(self, rig: Rig) -> list[Term]:
        """Return the terms that a finer grid may lift: the best of every effect alone, and those selected."""
        begun = self.regression.remainder([])
        alone: dict[str, tuple[float, int]] = {}
        for i, remainder in self.remainders([]):
            name = self.terms[i].effect.name
            alone[name] = min(alone.get(name, (remainder, i)), (remainder, i))
        least = min((remainder for remainder, _ in alone.values()), default=begun)
        near = [i for remainder, i in alone.values() if begun - remainder >= _NEAR * (begun - least) > 0.0]
        return [self.terms[i] for i in dict.fromkeys([*near, *(i for _, i, _ in self.selected(rig))])]

    def _forms(self, rig: Rig, key: Key, taken: int, chosen: Sequence[int]) -> tuple[ProposedForm, ...]:
        """Return the other forms of a selected family, beside the columns of the other families."""
        own = [i for i, term in enumerate(self.terms) if (term.effect.family, rig.where(term.effect)) == key]
        best: dict[str, tuple[float, int]] = {}
        for i, remainder in self.remainders(chosen, own):
            name = self.terms[i].effect.name
            best[name] = min(best.get(name, (remainder, i)), (remainder, i))
        whole = self.regression.remainder([*chosen, *self.places[taken]])
        return tuple(
            ProposedForm(self.terms[i].effect, self.parameters(i, chosen), remainder / whole)
            for name, (remainder, i) in best.items()
            if name != self.terms[taken].effect.name
        )

    def best(self, rig: Rig, chosen: Sequence[int], taken: Sequence[Key]) -> dict[Key, tuple[float, int]]:
        """Return the best term of each family at each place beside columns that were chosen, with what it leaves."""
        best: dict[Key, tuple[float, int]] = {}
        for i, remainder in self.remainders(chosen):
            key = (self.terms[i].effect.family, rig.where(self.terms[i].effect))
            if key not in taken and (key not in best or remainder < best[key][0]):
                best[key] = (remainder, i)
        return best

    def remainders(
        self, chosen: Sequence[int], asked: Sequence[int] | None = None
    ) -> Iterator[tuple[int, float]]:
        """Yield each (asked) term that can have the sign and order that it needs beside chosen columns, and what it leaves."""
        known = self._known.setdefault(tuple(chosen), {})
        for i in range(len(self.terms)) if asked is None else asked:
            if i not in known:
                beside = [*chosen, *self.places[i]]
                known[i] = self.regression.remainder(beside) if self.allows(i, chosen) else None
            own = known[i]
            if own is not None:
                yield i, own

    def allows(self, i: int, chosen: Sequence[int]) -> bool:
        """Return whether a term has the sign and order that it needs beside chosen columns."""
        own = self.places[i]
        return self.terms[i].allows(self.regression.solved([*chosen, *own])[-len(own) :])

    def selected(self, rig: Rig) -> list[tuple[Key, int, float]]:
        """Take families until none removes enough: each with its term and what it leaves beside those before it."""
        remainder, found = self.regression.remainder([]), list[tuple[Key, int, float]]()
        for _ in range(_MOST_CAUSES):
            chosen = self.columns_of(found)
            best = self.best(rig, chosen, [key for key, _, _ in found])
            key = min(best, key=lambda own: best[own][0], default=None)
            if key is None or not self.is_worth(best[key][0], remainder):
                break
            remainder, i = best[key]
            found.append((key, i, remainder))
        return self._plain(rig, found)

    def _plain(self, rig: Rig, found: Sequence[tuple[Key, int, float]]) -> list[tuple[Key, int, float]]:
        """Return selected families, each in its form with the fewest numbers that leaves no more than a law errs."""
        terms = [i for _, i, _ in found]
        for n, (key, i, _) in enumerate(found):
            chosen = [column for other in (*terms[:n], *terms[n + 1 :]) for column in self.places[other]]
            whole, without = (
                self.regression.remainder([*chosen, *self.places[i]]),
                self.regression.remainder(chosen),
            )
            enough = whole + LAW_ERROR**2 * (without - whole)
            own = [
                t for t, term in enumerate(self.terms) if (term.effect.family, rig.where(term.effect)) == key
            ]
            forms = [(remainder, t) for t, remainder in self.remainders(chosen, own) if remainder <= enough]
            terms[n] = min(
                forms, key=lambda form: (_n_fitted(self.terms[form[1]].effect), form[0]), default=(whole, i)
            )[1]
        columns = [[c for t in terms[: n + 1] for c in self.places[t]] for n in range(len(terms))]
        return [
            (key, t, self.regression.remainder(own))
            for (key, _, _), t, own in zip(found, terms, columns, strict=True)
        ]

    def columns_of(self, found: Sequence[tuple[Key, int, float]]) -> list[int]:
        """Return the columns of selected terms."""
        return [column for _, i, _ in found for column in self.places[i]]

    def is_worth(self, after: float, before: float) -> bool:
        """Return whether a further family removes enough: of what was left before, and beside what the laws taken before err."""
        of_laws = LAW_ERROR**2 * max(self.regression.remainder([]) - before, 0.0)
        return bool(before - after > max(max(WORTH, self.by_chance) * before, of_laws))

    def names(self, rig: Rig, key: Key, known: Sequence[tuple[Key, int, float]]) -> bool:
        """Return whether a family at a place is taken first beside known ones, or at another place that does the same."""
        chosen = self.columns_of(known)
        before, best = self.regression.remainder(chosen), self.best(rig, chosen, [own for own, _, _ in known])
        if key not in best:
            return False
        first = min(best, key=lambda own: best[own][0])
        as_good = best[first][0] + LAW_ERROR**2 * (before - best[first][0])
        is_first = first == key or (first[0] == key[0] and best[key][0] <= as_good)
        return is_first and self.is_worth(best[key][0], before)

    def proposal(self, rig: Rig) -> Proposal:
        """Return what every family explains alone, and those that are taken."""
        begun = self.regression.remainder([])
        best = self.best(rig, [], [])
        ordered = sorted(best.items(), key=lambda found: found[1][0])
        intervals = self._intervals([i for _, (_, i) in ordered])
        alone = tuple(
            replace(self._cause(key, i, 1.0 - own / begun, []), interval=interval)
            for (key, (own, i)), interval in zip(ordered, intervals, strict=True)
        )
        selected = self.selected(rig)
        remainders = [begun, *(own for _, _, own in selected)]
        beside = [self.columns_of([*selected[:n], *selected[n + 1 :]]) for n in range(len(selected))]
        taken = tuple(
            replace(
                self._cause(key, i, 1.0 - own / before, chosen),
                forms=self._forms(rig, key, i, chosen),
            )
            for (key, i, own), before, chosen in zip(selected, remainders, beside, strict=False)
        )
        judged = frozenset(term.effect.name for term in self.terms)
        explained = 1.0 - remainders[-1] / begun if begun > 0.0 else 0.0
        starts: dict[str, tuple[float, int]] = {}
        for i, remainder in self.remainders([]):
            name = self.terms[i].effect.name
            starts[name] = min(starts.get(name, (remainder, i)), (remainder, i))
        numbers = self.numbers_beside(begun, {name: i for name, (_, i) in starts.items()})
        return Proposal(
            taken,
            alone,
            judged,
            explained,
            self.by_chance,
            numbers=numbers.values(self.columns_of(selected)),
            numbers_beside=numbers,
            undecided=self.undecided,
            starts={
                name: ProposedStart(
                    _rounded(self.parameters(i, [])),
                    _rounded(numbers.values(self.places[i])),
                    remainder / begun if begun > 0.0 else 1.0,
                )
                for name, (remainder, i) in starts.items()
            },
        )

    def _intervals(self, terms: Sequence[int]) -> list[tuple[float, float]]:
        """Return the limits of the share that each term removes alone, over stretches drawn with replacement."""
        rng = np.random.default_rng(0)
        counts = rng.multinomial(STRETCHES, np.full(STRETCHES, 1.0 / STRETCHES), size=_DRAWS)
        begun = self.regression.remainders(counts, [])
        shares = [1.0 - self.regression.remainders(counts, self.places[i]) / begun for i in terms]
        return [(float(np.quantile(own, _LIMITS[0])), float(np.quantile(own, _LIMITS[1]))) for own in shares]

    def numbers_beside(self, missing: float, terms: Mapping[str, int]) -> NumbersBeside:
        """Return the numbers of the equations beside effects, of which each has a term."""
        of_rig = {p.name for p in self.fit.rig.parameters}
        return NumbersBeside(
            tuple(self.fit.free),
            tuple(name in of_rig for name in self.fit.free),
            tuple(name in self.fit.gains for name in self.fit.free),
            np.array([self.values[name] for name in self.fit.free]),
            self.fit.bounds,
            self.regression.sums(self.regression.whole),
            missing,
            {name: self.places[i] for name, i in terms.items()},
        )

    def _cause(self, key: Key, i: int, share: float, chosen: Sequence[int]) -> ProposedCause:
        return ProposedCause(self.terms[i].effect, *key, share, self.parameters(i, chosen))

    def parameters(self, i: int, chosen: Sequence[int]) -> dict[str, float]:
        """Return the parameters of the effect of a term beside chosen columns."""
        term, solved = self.terms[i], self.regression.solved([*chosen, *self.places[i]])
        numbers = solved[-len(self.places[i]) :]
        linear = {
            name: float(number) * unit
            for name, number, unit in zip(term.names, numbers, term.units, strict=False)
        }
        if term.effect.pulsation is not None:
            # A sine and a cosine of each record, whose amplitudes are those of one tone.
            (amplitude,) = term.effect.linear_parameters
            linear[amplitude.name] = float(np.sqrt(2.0 * np.mean(numbers**2)))
        ratio = term.effect.post_yield_stiffness_ratio
        if ratio is not None:
            linear[ratio] = self._soft_share(
                term.effect, float(numbers[0]), solved[: len(self.regression.own)]
            )
        return {**term.inner, **linear}

    def _soft_share(self, effect: Effect, coefficient: float, change: Floats) -> float:
        """Return the share of a joint's stiffness that its loop keeps, from the part that yields and a change of the numbers."""
        stiffness, known = joint_of(self.fit.rig, effect).stiffness, self.fit.motions[0].record.constants
        changed = {name: self.values[name] + own for name, own in zip(self.fit.free, change, strict=True)}
        before, after = (evaluated(stiffness, {**self.values, **own, **known}) for own in ({}, changed))
        least, most = _SHARES
        return float(np.clip(1.0 - coefficient * before / after, least, most)) if after > 0.0 else least


def _rounded(values: Mapping[str, float]) -> dict[str, float]:
    return {name: float(f"{value:.{_DIGITS}g}") for name, value in values.items()}


def _n_fitted(effect: Effect) -> int:
    return sum(parameter.fitted for parameter in effect.parameters)
