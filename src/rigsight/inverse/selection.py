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
from rigsight.inverse.numbers_beside import NumbersBeside
from rigsight.inverse.proposal import Proposal, ProposedCause, ProposedForm, ProposedStart
from rigsight.inverse.term import Term
from rigsight.rigs import Rig, evaluated
from rigsight.rigs.rig import joint_of

Floats = NDArray[np.float64]
Key = tuple[Family, str]
"""A family and the place at which it acts."""

_STRETCHES = 10
"""Number of parts of the records of which each is left out once."""
_MOST_CAUSES = 5
"""Families that are taken at most; a robot has three to five causes at once."""
_WORTH = 0.03
"""Least share of the residual that a further family must remove from stretches that it was not fitted to."""
_SIGNIFICANCE = 0.01
_DRAWS, _LIMITS = 100, (0.025, 0.975)
"""Resamplings of the stretches for the interval of a share, and its limits."""
_SMOOTH = 1e-9
_SHARES = (0.02, 0.98)
"""Limits of the share of the stiffness that a loop keeps: at 1 it would vanish."""
_NEAR = 0.5
"""Share of what the best effect alone removes from which on a finer grid may make another one the best (a convention)."""


class Selection:
    """Greedy selection of families by the residual of held-out stretches, on sums of products."""

    def __init__(
        self,
        fit: EquationFit,
        values: Mapping[str, float],
        terms: Sequence[Term],
        noise: Floats | None = None,
    ) -> None:
        self.fit, self.values, self.terms = fit, values, terms
        rows, slopes, stretch = [], [], []
        self.shapes: list[tuple[int, int]] = []
        self.weights: list[Floats] = []
        unit = fit.tolerance(values, noise)[:, None]
        # Together all rows have RMS one, for the ridge of the regression.
        self.unit = unit = unit * np.sqrt(np.mean((fit.rms(values)[:, None] / unit) ** 2))
        per_record = max(1, round(2 * _STRETCHES / len(fit.motions)))
        for i, motion in enumerate(fit.motions):
            weight = motion.row_weights[:, :: motion.stride] / unit
            own = motion.thinned(fit.residual(motion, values))
            rows.append(np.ravel(own * weight))
            slopes.append(_as_columns(motion.thinned(fit.slopes(motion, values)) * weight))
            self.weights.append(weight)
            n_equations, n = own.shape
            self.shapes.append((n_equations, n))
            stretch.append(np.tile(i * per_record + (np.arange(n) * per_record) // n, n_equations))
        target = -np.concatenate(rows)
        self.n_rows, self.groups = target.size, np.concatenate(stretch) % _STRETCHES
        own, columns = np.concatenate(slopes), self._columns(terms)
        self.own, self.places = list(range(own.shape[1])), _places(own.shape[1], terms)
        matrix = np.column_stack([own, columns, target])
        self.size = _sizes(matrix)
        self.size[-1] = 1.0
        self.matrix = matrix / self.size
        self.products = np.array([part.T @ part for part in map(self._stretch, range(_STRETCHES))])
        self.whole = np.sum(self.products, axis=0)
        # Limit of the largest share of the squares that one of so many columns explains (Bonferroni): the share that a column
        # explains by chance has a beta distribution. What laws leave moves with the motion: in its band lie fewer rows than in
        # that of the forces.
        independent = max(target.size / WIDER, 2.0)
        self.by_chance = 1.0 - (_SIGNIFICANCE / len(terms)) ** (2.0 / (independent - 1.0))

    def _columns(self, terms: Sequence[Term]) -> Floats:
        """Return the columns of terms, shape (n_rows, n_parts), weighted as all rows are."""
        weighted = [
            np.column_stack([_as_columns(term.columns[i] * weight) for term in terms])
            for i, weight in enumerate(self.weights)
        ]
        return np.concatenate(weighted)

    def _stretch(self, group: int) -> Floats:
        return np.asarray(self.matrix[self.groups == group])

    def with_terms(self, terms: Sequence[Term]) -> Selection:
        """Return the selection among further terms, too. Near ones of the grid add nothing to what chance explains."""
        if not terms:
            return self
        wider, new = copy(self), self._columns(terms)
        n = self.matrix.shape[1] - 1
        wider.terms, wider.places = [*self.terms, *terms], [*self.places, *_places(n, terms)]
        sizes = _sizes(new)
        wider.size = np.concatenate([self.size[:n], sizes, self.size[n:]])
        wider.matrix = np.column_stack([self.matrix[:, :n], new / sizes, self.matrix[:, n:]])
        at = np.r_[np.arange(n), wider.matrix.shape[1] - 1]
        wider.products = np.empty((_STRETCHES, wider.size.size, wider.size.size))
        for group in range(_STRETCHES):
            part = wider._stretch(group)
            wider.products[group][np.ix_(at, at)] = self.products[group]
            wider.products[group][:, n:-1] = part.T @ part[:, n:-1]
            wider.products[group][n:-1, :] = wider.products[group][:, n:-1].T
        wider.whole = np.sum(wider.products, axis=0)
        return wider

    def leading(self, rig: Rig) -> list[Term]:
        """Return the terms that a finer grid may lift: the best of every effect alone, and those selected."""
        begun = self.remainder([])
        alone: dict[str, tuple[float, int]] = {}
        for i, remainder in self._remainders([]):
            name = self.terms[i].effect.name
            alone[name] = min(alone.get(name, (remainder, i)), (remainder, i))
        least = min((remainder for remainder, _ in alone.values()), default=begun)
        near = [i for remainder, i in alone.values() if begun - remainder >= _NEAR * (begun - least) > 0.0]
        return [self.terms[i] for i in dict.fromkeys([*near, *(i for _, i, _ in self.selected(rig))])]

    def _solved(self, products: Floats, columns: Sequence[int]) -> Floats:
        """Return the numbers of columns, shape (.., n_columns), from sums of products, shape (.., n, n)."""
        at = np.asarray(columns, dtype=np.int64)
        normal = products[..., at[:, None], at]
        ridge = _SMOOTH * self.n_rows * np.eye(at.size)
        return np.asarray(np.linalg.solve(normal + ridge, products[..., at, -1:])[..., 0])

    def remainder(self, chosen: Sequence[int]) -> float:
        """Return the sum of squares of held-out stretches with further columns beside those of the equations."""
        return float(self._drawn(np.ones((1, _STRETCHES), dtype=np.int64), chosen)[0])

    def with_added(self, rows: Sequence[Floats]) -> Selection:
        """Return the selection for records in which a further force acts: what `EffectTerms.acting` gives."""
        own = np.concatenate([np.ravel(w * part) for w, part in zip(self.weights, rows, strict=True)])
        added = copy(self)
        added.products = self.products.copy()
        for g in range(_STRETCHES):
            here = self.groups == g
            change = self.matrix[here].T @ own[here]
            added.products[g, :, -1] += change
            added.products[g, -1, :] += change
            added.products[g, -1, -1] += own[here] @ own[here]
        added.whole = np.sum(added.products, axis=0)
        return added

    def resampled(self, rng: np.random.Generator) -> Selection:
        """Return the selection for stretches that are drawn with replacement."""
        drawn = copy(self)
        counts = rng.multinomial(_STRETCHES, np.full(_STRETCHES, 1.0 / _STRETCHES))
        drawn.products = counts[:, None, None] * self.products
        drawn.whole = np.sum(drawn.products, axis=0)
        return drawn

    def _forms(self, rig: Rig, key: Key, taken: int, chosen: Sequence[int]) -> tuple[ProposedForm, ...]:
        """Return the other forms of a selected family, beside the columns of the other families."""
        own = [i for i, term in enumerate(self.terms) if (term.effect.family, rig.where(term.effect)) == key]
        best: dict[str, tuple[float, int]] = {}
        for i, remainder in self._remainders(chosen, own):
            name = self.terms[i].effect.name
            best[name] = min(best.get(name, (remainder, i)), (remainder, i))
        whole = self.remainder([*chosen, *self.places[taken]])
        return tuple(
            ProposedForm(self.terms[i].effect, self._values(i, chosen), remainder / whole)
            for name, (remainder, i) in best.items()
            if name != self.terms[taken].effect.name
        )

    def best(self, rig: Rig, chosen: Sequence[int], taken: Sequence[Key]) -> dict[Key, tuple[float, int]]:
        """Return the best term of each family at each place beside columns that were chosen, with what it leaves."""
        best: dict[Key, tuple[float, int]] = {}
        for i, remainder in self._remainders(chosen):
            key = (self.terms[i].effect.family, rig.where(self.terms[i].effect))
            if key not in taken and (key not in best or remainder < best[key][0]):
                best[key] = (remainder, i)
        return best

    def _remainders(
        self, chosen: Sequence[int], asked: Sequence[int] | None = None
    ) -> Iterator[tuple[int, float]]:
        """Yield each (asked) term that can have the sign and order that it needs beside chosen columns, and what it leaves."""
        for i in range(len(self.terms)) if asked is None else asked:
            term = self.terms[i]
            columns = [*chosen, *self.places[i]]
            own = self._solved(self.whole, [*self.own, *columns])[-len(self.places[i]) :]
            if term.allows(own / self.size[self.places[i]]):
                yield i, self.remainder(columns)

    def selected(self, rig: Rig) -> list[tuple[Key, int, float]]:
        """Take families until none removes enough: each with its term and what it leaves beside those before it."""
        remainder, found = self.remainder([]), list[tuple[Key, int, float]]()
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
            whole, without = self.remainder([*chosen, *self.places[i]]), self.remainder(chosen)
            enough = whole + LAW_ERROR**2 * (without - whole)
            own = [
                t for t, term in enumerate(self.terms) if (term.effect.family, rig.where(term.effect)) == key
            ]
            forms = [(remainder, t) for t, remainder in self._remainders(chosen, own) if remainder <= enough]
            terms[n] = min(
                forms, key=lambda form: (_n_fitted(self.terms[form[1]].effect), form[0]), default=(whole, i)
            )[1]
        columns = [[c for t in terms[: n + 1] for c in self.places[t]] for n in range(len(terms))]
        return [
            (key, t, self.remainder(own)) for (key, _, _), t, own in zip(found, terms, columns, strict=True)
        ]

    def residuals(self, found: Sequence[tuple[Key, int, float]]) -> list[Floats]:
        """Return what selected terms leave along each motion, shape (n_equations, n_rows) each; zero where nothing moves."""
        columns = [*self.own, *self.columns_of(found)]
        left = self.matrix[:, -1] - self.matrix[:, columns] @ self._solved(self.whole, columns)
        parts = np.split(left, np.cumsum([np.prod(shape) for shape in self.shapes])[:-1])
        return [part.reshape(shape) * self.unit for part, shape in zip(parts, self.shapes, strict=True)]

    def columns_of(self, found: Sequence[tuple[Key, int, float]]) -> list[int]:
        """Return the columns of selected terms."""
        return [column for _, i, _ in found for column in self.places[i]]

    def is_worth(self, after: float, before: float) -> bool:
        """Return whether a further family removes enough: of what was left before, and beside what the laws taken before err."""
        of_laws = LAW_ERROR**2 * max(self.remainder([]) - before, 0.0)
        return bool(before - after > max(max(_WORTH, self.by_chance) * before, of_laws))

    def names(self, rig: Rig, key: Key, known: Sequence[tuple[Key, int, float]]) -> bool:
        """Return whether a family at a place is taken first beside known ones."""
        chosen = self.columns_of(known)
        best = self.best(rig, chosen, [own for own, _, _ in known])
        first = min(best, key=lambda own: best[own][0], default=None)
        return first == key and self.is_worth(best[key][0], self.remainder(chosen))

    def proposal(self, rig: Rig) -> Proposal:
        """Return what every family explains alone, and those that are taken."""
        begun = self.remainder([])
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
        for i, remainder in self._remainders([]):
            name = self.terms[i].effect.name
            starts[name] = min(starts.get(name, (remainder, i)), (remainder, i))
        beside_any = self._numbers_beside(begun, {name: i for name, (_, i) in starts.items()})

        def numbers(columns: Sequence[int]) -> dict[str, float]:
            return dict(zip(beside_any.names, map(float, beside_any.values(columns)), strict=True))

        return Proposal(
            taken,
            alone,
            judged,
            explained,
            self.by_chance,
            numbers=numbers(self.columns_of(selected)),
            numbers_beside=beside_any,
            starts={
                name: ProposedStart(self._values(i, []), numbers(self.places[i]))
                for name, (_, i) in starts.items()
            },
        )

    def _intervals(self, terms: Sequence[int]) -> list[tuple[float, float]]:
        """Return the limits of the share that each term removes alone, over stretches drawn with replacement."""
        rng = np.random.default_rng(0)
        counts = rng.multinomial(_STRETCHES, np.full(_STRETCHES, 1.0 / _STRETCHES), size=_DRAWS)
        begun = self._drawn(counts, [])
        shares = [1.0 - self._drawn(counts, self.places[i]) / begun for i in terms]
        return [(float(np.quantile(own, _LIMITS[0])), float(np.quantile(own, _LIMITS[1]))) for own in shares]

    def _drawn(self, counts: NDArray[np.int64], chosen: Sequence[int]) -> Floats:
        """Return what `remainder` is for stretches drawn so often, shape (n_draws, n_stretches) -> (n_draws,)."""
        at = np.asarray([*self.own, *chosen, self.matrix.shape[1] - 1], dtype=np.int64)
        parts = counts[:, :, None, None] * self.products[:, at[:, None], at]
        whole = np.sum(parts, axis=1, keepdims=True)
        rest = whole - parts
        ridge = _SMOOTH * self.n_rows * np.eye(at.size - 1)
        x = np.linalg.solve(rest[..., :-1, :-1] + ridge, rest[..., :-1, -1:])[..., 0]
        along = np.einsum("dgi,dgi->d", x, parts[..., :-1, -1])
        squares = np.einsum("dgi,dgij,dgj->d", x, parts[..., :-1, :-1], x)
        least = np.finfo(np.float64).tiny
        return np.asarray(np.maximum(whole[:, 0, -1, -1] - 2.0 * along + squares, least))

    def _numbers_beside(self, missing: float, terms: Mapping[str, int]) -> NumbersBeside:
        """Return the numbers of the equations beside effects, of which each has a term."""
        of_rig = {p.name for p in self.fit.rig.parameters}
        return NumbersBeside(
            tuple(self.fit.free),
            tuple(name in of_rig for name in self.fit.free),
            np.array([self.values[name] for name in self.fit.free]),
            self.fit.bounds,
            self.size[self.own],
            self.whole / self.n_rows,
            missing / self.n_rows,
            {name: self.places[i] for name, i in terms.items()},
            _SMOOTH,
        )

    def _cause(self, key: Key, i: int, share: float, chosen: Sequence[int]) -> ProposedCause:
        return ProposedCause(self.terms[i].effect, *key, share, self._values(i, chosen))

    def _values(self, i: int, chosen: Sequence[int]) -> dict[str, float]:
        """Return the parameters of the effect of a term beside chosen columns."""
        term, columns = self.terms[i], [*self.own, *chosen, *self.places[i]]
        solved = self._solved(self.whole, columns) / self.size[columns]
        numbers = solved[-len(self.places[i]) :]
        linear = {
            name: float(number) * unit
            for name, number, unit in zip(term.names, numbers, term.units, strict=False)
        }
        ratio = term.effect.post_yield_stiffness_ratio
        if ratio is not None:
            linear[ratio] = self._soft_share(term.effect, float(numbers[0]), solved[: len(self.own)])
        return {**term.inner, **linear}

    def _soft_share(self, effect: Effect, coefficient: float, change: Floats) -> float:
        """Return the share of a joint's stiffness that its loop keeps, from the part that yields and a change of the numbers."""
        stiffness, known = joint_of(self.fit.rig, effect).stiffness, self.fit.motions[0].record.constants
        changed = {name: self.values[name] + own for name, own in zip(self.fit.free, change, strict=True)}
        before, after = (evaluated(stiffness, {**self.values, **own, **known}) for own in ({}, changed))
        least, most = _SHARES
        return float(np.clip(1.0 - coefficient * before / after, least, most)) if after > 0.0 else least


def _n_fitted(effect: Effect) -> int:
    return sum(parameter.fitted for parameter in effect.parameters)


def _places(first: int, terms: Sequence[Term]) -> list[list[int]]:
    """Return the columns of each term, from the first one on."""
    ends = np.cumsum([first, *(len(term.one_sided) for term in terms)])
    return [list(range(a, b)) for a, b in pairwise(ends)]


def _sizes(columns: Floats) -> Floats:
    """Return the RMS of each column, 1 for an empty one."""
    found = np.sqrt(np.mean(columns**2, axis=0))
    return np.where(found == 0.0, 1.0, found)


def _as_columns(rows: Floats) -> Floats:
    """Return rows (n_columns, n_equations, n_rows) as columns with all equations one after the other."""
    return np.reshape(rows, (rows.shape[0], rows.shape[1] * rows.shape[2])).T
