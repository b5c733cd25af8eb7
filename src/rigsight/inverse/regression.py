"""The equations along all motions as one linear regression, judged on stretches of the records left out.

The rows are those of the motions, weighted by what laws and noise leave. Everything follows from their sums of products over each
stretch. Residuals are forces: equations in which all masses and forces shrink leave less force, and predict no acceleration
better. Their density as a function of the accelerations holds the determinant of the mass matrix, which changes with the numbers.

References
----------
A. Papoulis, *Probability, Random Variables, and Stochastic Processes* (McGraw-Hill 1991), for transformed densities.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.inverse.equation_fit import EquationFit

Floats = NDArray[np.float64]

STRETCHES = 10
"""Number of parts of the records of which each is left out once."""
_SAMPLES = 8
"""Samples of each motion over which the mass matrix is averaged (a convention)."""
_SMALL = 1e-4
"""Relative change of a number from which the change of the mass matrix is taken."""
_SMOOTH = 1e-9
"""Added to the mean square of each column, which is one: what nothing determines stays."""
_ROUNDS = 3
"""Steps to the likeliest numbers; for one mass the first one is exact."""
_ROUNDING = 1e-12
"""Error of sums of squares by rounding, relative to those of the missing force."""
_LEAST = float(np.finfo(np.float64).tiny)
_WORTHLESS = 1e9
"""Factor of what is left beside a force with which no mass is positive."""


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products of all columns, from which the numbers of the equations beside any columns follow."""

    # Of the scaled columns, the missing force last, shape (.., n_columns + 1, n_columns + 1).
    products: Floats
    size: Floats  # of each column before it was scaled to a mean square of one, shape (n_columns + 1,)
    own: Sequence[int]  # columns of the numbers of the equations
    given: frozenset[int]  # columns that are a force as it is, not that of a unit of a number
    n_rows: int

    def solved(self, chosen: Sequence[int]) -> Floats:
        """Return the numbers of the equations and of chosen columns, shape (n,); 1 for a given force."""
        columns = np.array([*self.own, *chosen], dtype=np.int64)
        found = np.ones(columns.size)
        free = np.array([column not in self.given for column in columns], dtype=np.bool_)
        found[free] = _numbers(self.system(chosen), self.n_rows) / self.size[columns][free]
        return found

    def normal(self, chosen: Sequence[int]) -> Floats:
        """Return the sums of products of the columns that are free, shape (.., n_free, n_free), with the ridge."""
        return _with_ridge(self.system(chosen), self.n_rows)

    def system(self, chosen: Sequence[int]) -> Floats:
        """Return the sums of products of the columns that are free, and of the force missing beside those given."""
        free = [column for column in chosen if column not in self.given]
        given = np.array([column for column in chosen if column in self.given], dtype=np.int64)
        at = np.array([*self.own, *free, self.size.size - 1], dtype=np.int64)
        found = np.asarray(self.products[..., at[:, None], at])
        if given.size:
            force = self.size[given]
            along = self.products[..., at[:, None], given] @ force
            found = found.copy()
            found[..., -1, :] -= along
            found[..., :, -1] -= along
            found[..., -1, -1] += self.products[..., given[:, None], given] @ force @ force
        return found


class Regression:
    """Columns of the numbers of the equations first, then those of effects, then the missing force."""

    def __init__(self, fit: EquationFit, values: Mapping[str, float], noise: Floats | None = None) -> None:
        rows, slopes, stretch = [], [], []
        self.shapes: list[tuple[int, int]] = []
        self.weights: list[Floats] = []
        unit = fit.tolerance(values, noise)[:, None]
        # Together all rows have RMS one, for the ridge of the regression.
        self.unit = unit = unit * np.sqrt(np.mean((fit.rms(values)[:, None] / unit) ** 2))
        per_record = max(1, round(2 * STRETCHES / len(fit.motions)))
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
        self.n_rows, self.groups = target.size, np.concatenate(stretch) % STRETCHES
        own = np.concatenate(slopes)
        self.own = list(range(own.shape[1]))
        self.mass = MassDeterminant(fit, values)
        self.size = np.r_[_sizes(own), 1.0]
        self.matrix = np.column_stack([own / self.size[:-1], target])
        self.products = np.array([part.T @ part for part in map(self._stretch, range(STRETCHES))])
        self.whole = np.sum(self.products, axis=0)
        self.given = frozenset[int]()
        self._factors: dict[tuple[int, ...], Floats] = {}

    @property
    def n_columns(self) -> int:
        """Number of the columns before the missing force."""
        return int(self.size.size) - 1

    def _stretch(self, group: int) -> Floats:
        return np.asarray(self.matrix[self.groups == group])

    def with_columns(self, columns: Sequence[Sequence[Floats]], given: Sequence[bool]) -> Regression:
        """Return the regression with further columns.

        Parameters
        ----------
        columns
            Of each effect along each motion, shape (n_parts, n_equations, n_rows) each.
        given
            Whether the columns of each effect are a force, not that of a unit of a number.
        """
        new = np.concatenate(
            [
                np.column_stack([_as_columns(own[i] * weight) for own in columns])
                for i, weight in enumerate(self.weights)
            ]
        )
        wider, n = copy(self), self.matrix.shape[1] - 1
        sizes = _sizes(new)
        wider.size = np.concatenate([self.size[:n], sizes, self.size[n:]])
        wider.matrix = np.column_stack([self.matrix[:, :n], new / sizes, self.matrix[:, n:]])
        at = np.r_[np.arange(n), wider.matrix.shape[1] - 1]
        wider.products = np.empty((STRETCHES, wider.size.size, wider.size.size))
        for group in range(STRETCHES):
            part = wider._stretch(group)
            wider.products[group][np.ix_(at, at)] = self.products[group]
            wider.products[group][:, n:-1] = part.T @ part[:, n:-1]
            wider.products[group][n:-1, :] = wider.products[group][:, n:-1].T
        wider.whole = np.sum(wider.products, axis=0)
        of_each = [len(own[0]) for own in columns]
        wider.given = self.given | set((n + np.flatnonzero(np.repeat(given, of_each))).tolist())
        return wider

    def with_added(self, rows: Sequence[Floats]) -> Regression:
        """Return the regression for records in which a further force acts: what `EffectTerms.acting` gives."""
        own = np.concatenate([np.ravel(w * part) for w, part in zip(self.weights, rows, strict=True)])
        added = copy(self)
        added.products = self.products.copy()
        for g in range(STRETCHES):
            here = self.groups == g
            change = self.matrix[here].T @ own[here]
            added.products[g, :, -1] += change
            added.products[g, -1, :] += change
            added.products[g, -1, -1] += own[here] @ own[here]
        added.whole = np.sum(added.products, axis=0)
        added._factors = {}
        return added

    def resampled(self, counts: NDArray[np.int64]) -> Regression:
        """Return the regression for records in which each stretch occurs so often."""
        drawn = copy(self)
        drawn.products = counts[:, None, None] * self.products
        drawn.whole = np.sum(drawn.products, axis=0)
        drawn._factors = {}
        return drawn

    def sums(self, products: Floats) -> Sums:
        """Return sums of products, such as `whole`, as a system of equations."""
        return Sums(products, self.size, self.own, self.given, self.n_rows)

    def solved(self, chosen: Sequence[int]) -> Floats:
        """Return the numbers of the equations and of chosen columns, shape (n,); 1 for a given force."""
        return self.sums(self.whole).solved(chosen)

    def residuals(self, chosen: Sequence[int]) -> list[Floats]:
        """Return what chosen columns leave along each motion, shape (n_equations, n_rows) each; zero where nothing moves."""
        columns = np.array([*self.own, *chosen], dtype=np.int64)
        left = self.matrix[:, -1] - self.matrix[:, columns] @ (self.solved(chosen) * self.size[columns])
        parts = np.split(left, np.cumsum([np.prod(shape) for shape in self.shapes])[:-1])
        return [part.reshape(shape) * self.unit for part, shape in zip(parts, self.shapes, strict=True)]

    def misfit(self, chosen: Sequence[int]) -> float:
        """Return the sum of squares that further columns leave beside those of the equations, all fitted to all stretches."""
        products = self.sums(self.whole).system(chosen)
        return max(float(_squares(products, _numbers(products, self.n_rows))), _LEAST)

    @property
    def predicts_accelerations(self) -> bool:
        """Whether the likeliest numbers of the equations alone have positive masses on all stretches."""
        return bool(
            np.all(np.isfinite(self._left(np.ones((1, STRETCHES), dtype=np.int64), (), likeliest=True)))
        )

    def remainder(self, chosen: Sequence[int]) -> float:
        """Return the sum of squares of held-out stretches with further columns beside those of the equations."""
        return float(self.remainders(np.ones((1, STRETCHES), dtype=np.int64), chosen)[0])

    def remainders(self, counts: NDArray[np.int64], chosen: Sequence[int]) -> Floats:
        """Return what `remainder` is for stretches drawn so often, shape (n_draws, n_stretches) -> (n_draws,)."""
        given = tuple(column for column in chosen if column in self.given)
        found = self._left(counts, chosen)
        return found if not given else np.maximum(found * self._comparable(counts, given), _LEAST)

    def _comparable(self, counts: NDArray[np.int64], given: tuple[int, ...]) -> Floats:
        """Return the factor that makes what is left beside given forces comparable with what is left beside other effects.

        Smaller masses alone leave less force. So it counts how much better the likeliest numbers predict the accelerations: no
        scale of forces changes this.
        """
        if given in self._factors and len(counts) == 1:
            return self._factors[given]
        before, beside = (self._left(counts, own, likeliest=True) for own in ((), given))
        with np.errstate(all="ignore"):
            better = np.minimum(np.nan_to_num(beside / before, nan=_WORTHLESS), _WORTHLESS)
        factor = better * self._left(counts, ()) / self._left(counts, given)
        if len(counts) == 1:
            self._factors[given] = factor
        return np.asarray(factor)

    def _left(self, counts: NDArray[np.int64], chosen: Sequence[int], *, likeliest: bool = False) -> Floats:
        parts = counts[:, :, None, None] * self.sums(self.products).system(chosen)
        rest = np.sum(parts, axis=1, keepdims=True) - parts
        x = self._likeliest(rest) if likeliest else _numbers(rest, self.n_rows)
        # Where a given force takes all of the input, the numbers vanish and rounding is left.
        squares = np.maximum(_squares(parts, x), _ROUNDING * parts[..., -1, -1])
        if likeliest:
            log_ratio = self.mass.log_ratio(x[..., : len(self.own)] / self.size[self.own])
            scale = np.exp(-2.0 * np.where(np.isfinite(log_ratio), log_ratio, 0.0) / max(self.mass.order, 1))
            squares = np.where(np.isfinite(log_ratio), squares * scale, np.inf)
        return np.asarray(np.maximum(np.sum(squares, axis=1), _LEAST))

    def _likeliest(self, products: Floats) -> Floats:
        """Return numbers at which ``log(squares) - 2 log(det M) / n`` is stationary, of n equations with masses M."""
        x = _numbers(products, self.n_rows)
        if not self.mass.is_open:
            return x
        n_own, size = len(self.own), self.size[self.own]
        for _ in range(_ROUNDS):
            pulled = products.copy()
            slope = self.mass.slope(x[..., :n_own] / size) / size
            pulled[..., :n_own, -1] += _squares(products, x)[..., None] * slope / self.mass.order
            x = _numbers(pulled, self.n_rows)
        return x


def _numbers(products: Floats, n_rows: int) -> Floats:
    """Return the numbers of columns, shape (.., n), from sums of products, shape (.., n + 1, n + 1)."""
    return np.asarray(np.linalg.solve(_with_ridge(products, n_rows), products[..., :-1, -1:])[..., 0])


def _with_ridge(products: Floats, n_rows: int) -> Floats:
    return np.asarray(products[..., :-1, :-1] + _SMOOTH * n_rows * np.eye(products.shape[-1] - 1))


def _squares(products: Floats, x: Floats) -> Floats:
    """Return the sum of squares that numbers leave, shape (..,)."""
    along = np.einsum("...i,...i->...", x, products[..., :-1, -1])
    own = np.einsum("...i,...ij,...j->...", x, products[..., :-1, :-1], x)
    return np.asarray(products[..., -1, -1] - 2.0 * along + own)


def _sizes(columns: Floats) -> Floats:
    """Return the RMS of each column, 1 for an empty one."""
    found = np.sqrt(np.mean(columns**2, axis=0))
    return np.where(found == 0.0, 1.0, found)


def _as_columns(rows: Floats) -> Floats:
    """Return rows (n_columns, n_equations, n_rows) as columns with all equations one after the other."""
    return np.reshape(rows, (rows.shape[0], rows.shape[1] * rows.shape[2])).T


class MassDeterminant:
    """The mass matrix of a rig to first order in the numbers of its equations."""

    def __init__(self, fit: EquationFit, values: Mapping[str, float]) -> None:
        self.order = fit.motions[0].equations.n_coordinates
        self._start = _masses(fit, values)
        slopes = np.zeros((len(fit.free), *self._start.shape))
        for slope, name in zip(slopes, fit.free, strict=True):
            step = _SMALL * (abs(values[name]) or 1.0)
            slope[:] = (_masses(fit, {**values, name: values[name] + step}) - self._start) / step
        self._slopes = slopes
        self._log_start = np.linalg.slogdet(self._start)[1]

    @property
    def is_open(self) -> bool:
        """Whether numbers change the mass matrix."""
        return bool(np.any(self._slopes))

    def log_ratio(self, change: Floats) -> Floats:
        """Return the mean logarithm of the determinant after a change of the numbers, less that before it.

        Parameters
        ----------
        change
            Shape (.., n_numbers).

        Returns
        -------
            Shape (..,); minus infinity where a mass is not positive.
        """
        sign, log = np.linalg.slogdet(self._changed(change))
        return np.asarray(np.mean(np.where(sign > 0.0, log, -np.inf) - self._log_start, axis=-1))

    def slope(self, change: Floats) -> Floats:
        """Return the derivatives of `log_ratio` by the numbers, of the same shape as their change."""
        inverse = np.linalg.pinv(self._changed(change))
        return np.asarray(np.einsum("...kij,fkji->...f", inverse, self._slopes) / len(self._start))

    def _changed(self, change: Floats) -> Floats:
        return np.asarray(self._start + np.tensordot(change, self._slopes, axes=(-1, 0)))


def _masses(fit: EquationFit, values: Mapping[str, float]) -> Floats:
    """Return the mass matrix at some samples of all motions, shape (n_samples, n_coordinates, n_coordinates)."""
    found = []
    for motion in fit.motions:
        at = np.linspace(0, motion.record.n_samples - 1, _SAMPLES).astype(np.int64)
        p = motion.equations.parameters(values, motion.record)
        found.append(motion.equations.mass(motion.z[:, at], motion.u[:, at], p) * fit.per_input(values))
    return np.concatenate(found)
