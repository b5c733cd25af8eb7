"""Estimates from some records or windows alone, with their uncertainty: one Gauss-Newton step from the common fit.

The noise spectrum of each record is that of an autoregressive model, which can resolve a resonance. An average over neighboring
lines of a short record is wider than the resonance, where a disturbance is strongest, and so underestimates the uncertainty.

References
----------
L. Ljung, *System Identification* (Prentice Hall 1999), chapter 9, for the covariance beside colored residuals. F. E.
Satterthwaite, Biometrics Bulletin 2 (1946) 110, for the degrees of freedom of an estimated variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from rigsight.diagnose.noise.innovations import whitening_filter
from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.patterns import Order, Pattern
from rigsight.diagnose.trust.pieces import Piece, Pieces, pseudo_inverse
from rigsight.identify import DEFAULT_ACCURACY, SMOOTHED, sandwich_covariance, spectral_product
from rigsight.identify.fit.covariance import symmetric_eigen
from rigsight.identify.information import POORLY_KNOWN
from rigsight.records.record import Floats


@dataclass(frozen=True)
class NoiseSpectra:
    """Residual spectra of whole records, by the name of the record."""

    # Whitening filters by output, first of each number of outputs that a record holds.
    filters: dict[int, list[Floats]]
    powers: dict[str, list[float]]  # power of the innovations, by record and output
    # By record: ratio of the noise power before the fit to the residual power, in the band that determines
    # each parameter, shape (n_free,).
    taken: dict[str, Floats]

    @classmethod
    def of(cls, whole: Sequence[Piece]) -> NoiseSpectra:
        """Return the residual spectra of records with their own parameters refitted."""
        filters: dict[int, list[Floats]] = {}
        powers: dict[str, list[float]] = {}
        taken: dict[str, Floats] = {}
        for count in {piece.n_measured for piece in whole}:
            alike = [piece.noise.reshape(count, -1) for piece in whole if piece.n_measured == count]
            filters[count] = [whitening_filter([own[i] for own in alike]) for i in range(count)]
        found = cls(filters, powers, taken)
        for name in dict.fromkeys(piece.record for piece in whole):
            own = [piece for piece in whole if piece.record == name]
            count = own[0].n_measured
            powers[name] = [
                float(np.mean(np.concatenate([_new(p.noise.reshape(count, -1)[i], ar) for p in own]) ** 2))
                for i, ar in enumerate(filters[count])
            ]
            factors = []
            for piece in own:
                shares = found._shares(piece, pseudo_inverse(piece.rows).T)
                freedom = (
                    2.0
                    * np.sum(shares, axis=0) ** 2
                    / np.maximum(np.sum(shares**2, axis=0), np.finfo(float).tiny)
                )
                factors.append(freedom / np.maximum(freedom - piece.n_own, TRUST.least_freedom))
            taken[name] = np.maximum(1.0, np.mean(factors, axis=0))
        return found

    def variances(self, piece: Piece, columns: Floats) -> Floats:
        """Return the variance that the noise of a record gives to linear estimates."""
        return np.asarray(np.sum(self._shares(piece, columns), axis=0) * self.taken[piece.record])

    def _shares(self, piece: Piece, columns: Floats) -> Floats:
        """Return what each line of each output adds to the variance, shape (n_measured * n_lines, n)."""
        count, filters = piece.n_measured, self.filters[piece.n_measured]
        by_output = columns.reshape(count, -1, columns.shape[1])
        n, found = by_output.shape[1], []
        for own, ar, power in zip(by_output, filters, self.powers[piece.record], strict=True):
            white = np.abs(np.fft.rfft(ar, n)) ** 2
            found.append(2.0 / n * np.abs(np.fft.rfft(own, axis=0)) ** 2 * (power / white)[:, None])
        return np.concatenate(found)


def _new(noise: Floats, ar: Floats) -> Floats:
    """Return what is new at each sample that has samples enough before."""
    return np.asarray(lfilter(ar, [1.0], noise)[min(ar.size - 1, noise.size - 1) :])


@dataclass(frozen=True)
class Estimates:
    """Parameters estimated from some pieces alone."""

    shifts: Floats  # difference from the common fit, in units of the parameters, shape (n_free,)
    variances: Floats  # infinite where these pieces do not determine a number, shape (n_free,)
    freedom: Floats  # degrees of freedom of these variances, shape (n_free,)


def estimates(of: Pieces, some: Sequence[Piece], spectra: NoiseSpectra, kept: NDArray[np.bool_]) -> Estimates:
    """Return the parameters estimated from some pieces."""
    inverse, infinite = _inverse(of, some, kept)
    away = -inverse @ sum((piece.rows.T @ piece.residuals for piece in some), start=np.zeros(len(of.free)))
    # A step that is longer than coordinates can count says no more than that.
    there = np.clip(of.place + away, of.coordinates.lower, of.coordinates.upper)
    shifts = of.coordinates.to_parameters(there)[of.coordinates.index] - of.values
    chain, parts = of.coordinates.jacobian(there), []
    unknown = np.any(chain[:, infinite] != 0.0, axis=1)
    for piece in some:
        columns = piece.rows @ (chain @ inverse).T
        parts.append(_Variance.of(spectra, piece, columns))
    variances, freedom = _together(parts)
    return Estimates(shifts, _widened(of, variances, unknown), freedom)


def beyond(of: Pieces, windows: Sequence[Piece], spectra: NoiseSpectra, kept: NDArray[np.bool_]) -> Estimates:
    """Return the difference between pooled windows and the whole records that they cover (Hausman)."""
    # J. A. Hausman, Econometrica 46 (1978) 1251, for the difference of two estimates from the same data.
    plain, infinite = _inverse(of, windows, kept)
    chain = of.coordinates.jacobian(of.place)
    inverse, unknown = chain @ plain, np.any(chain[:, infinite] != 0.0, axis=1)
    shifts, parts = np.zeros(len(of.free)), []
    for whole in of.whole:
        own = [piece for piece in windows if piece.record == whole.record]
        rows = _joined([piece.rows for piece in own], whole.n_measured)
        remainder = _joined([piece.residuals[:, None] for piece in own], whole.n_measured)[:, 0]
        shifts -= inverse @ (rows.T @ remainder)
        # Windows are counted from the record's own numbers, which hang on the same noise.
        centered = np.zeros_like(rows)
        centered[:, kept] = pseudo_inverse(whole.rows[:, kept]).T
        columns = rows @ inverse.T - centered @ (inverse @ (rows.T @ rows)).T
        parts.append(_Variance.of(spectra, whole, columns))
    variances, freedom = _together(parts)
    return Estimates(shifts, _widened(of, variances, unknown), freedom)


def mean(several: Sequence[Estimates]) -> Estimates:
    """Return the mean of independent estimates, each with the weight of its own variance."""
    weights = np.array([1.0 / one.variances for one in several])
    total = np.sum(weights, axis=0)
    # A number that none of them determines has no weight anywhere.
    whole = np.where(total > 0.0, total, 1.0)
    shifts = np.sum(weights * np.array([one.shifts for one in several]), axis=0) / whole
    spread = np.sum(weights**2 / np.array([one.freedom for one in several]), axis=0)
    freedom = np.where(spread > 0.0, total**2 / np.where(spread > 0.0, spread, 1.0), TRUST.least_freedom)
    return Estimates(shifts, np.where(total > 0.0, 1.0 / whole, np.inf), freedom)


def told_by_most(of: Pieces, groups: Sequence[Sequence[Piece]]) -> NDArray[np.bool_]:
    """Return which parameters most groups determine alone when the others are held at the common fit, shape (n_free,)."""
    # A parameter that is equivalent to another in most groups, such as the two terms of a friction under a single load, is left
    # out; the other then represents both.
    kept = np.ones(len(of.free), dtype=bool)
    while np.any(kept):
        worst = [own for group in groups if (own := _loosest(of, group, kept)) is not None]
        if 2 * len(worst) <= len(groups):
            break
        kept[max(set(worst), key=worst.count)] = False
    return kept


def _loosest(of: Pieces, some: Sequence[Piece], kept: NDArray[np.bool_]) -> int | None:
    """Return the parameter with the largest part in the undetermined directions of pieces; None if there are none."""
    normal = _normal(of, some)[np.ix_(kept, kept)]
    if not np.any(np.isinf(np.diag(sandwich_covariance(normal, normal, of.derivative_error)))):
        return None
    size = np.sqrt(np.diag(normal))
    size[size == 0.0] = 1.0
    direction = np.abs(symmetric_eigen(normal / np.outer(size, size))[1][:, 0])
    # Of two that take part alike the last one goes: rigs come before effects, and what an effect is first named for stands first.
    largest = np.flatnonzero(direction >= TRUST.in_order * np.max(direction))[-1]
    return int(np.flatnonzero(kept)[largest])


def _normal(of: Pieces, some: Sequence[Piece]) -> Floats:
    none = np.zeros((len(of.free), len(of.free)))
    return np.asarray(sum((piece.rows.T @ piece.rows for piece in some), start=none))


def _inverse(of: Pieces, some: Sequence[Piece], kept: NDArray[np.bool_]) -> tuple[Floats, NDArray[np.bool_]]:
    """Return (J^T J)^-1, shape (n_free, n_free), and which coordinates J^T J does not determine."""
    normal, covariance = _normal(of, some), np.diag(np.full(len(of.free), np.inf))
    own = normal[np.ix_(kept, kept)]
    covariance[np.ix_(kept, kept)] = sandwich_covariance(own, own, of.derivative_error)
    infinite = np.isinf(np.diag(covariance))
    return np.where(infinite[:, None] | infinite[None, :], 0.0, covariance), infinite


def _widened(of: Pieces, variances: Floats, unknown: NDArray[np.bool_]) -> Floats:
    """Return variances that include the accuracy of the simulations in a fit; infinite where nothing is known."""
    return np.where(unknown, np.inf, variances + (DEFAULT_ACCURACY * of.values) ** 2)


def _joined(parts: Sequence[Floats], n_measured: int) -> Floats:
    """Return rows of windows as rows of the whole record: each output runs on from window to window."""
    by_output = [part.reshape(n_measured, -1, part.shape[1]) for part in parts]
    whole = np.concatenate(by_output, axis=1)
    return whole.reshape(-1, whole.shape[2])


@dataclass(frozen=True)
class _Variance:
    """What one piece's noise makes of linear estimates: variance and the variance of that, each of shape (n_free,).

    The larger of two: the smoothed spectrum of a fit's standard errors holds for any noise, an autoregression is sharp.
    """

    size: Floats
    spread: Floats

    @classmethod
    def of(cls, spectra: NoiseSpectra, piece: Piece, columns: Floats) -> _Variance:
        count, noise = piece.n_measured, piece.noise
        smoothed = np.diag(spectral_product(noise, columns, count))
        n = noise.size // count
        lines = np.abs(np.fft.rfft(noise.reshape(count, n), axis=1)) ** 2 / n
        weights = np.abs(np.fft.rfft(columns.reshape(count, n, -1), axis=1)) ** 2 / n
        # The variance is a sum over lines, each of which counts with the weights of its neighbors too.
        shares = 2.0 * lines[:, :, None] * uniform_filter1d(weights, SMOOTHED, axis=1, mode="constant")
        # A line has two degrees of freedom: its variance is its squared mean, half of the mean of its square.
        spread = np.sum(shares**2, axis=(0, 1)) / 2.0
        freedom = 2.0 * smoothed**2 / np.maximum(spread, np.finfo(float).tiny)
        remainder = np.maximum(freedom - piece.n_own, TRUST.least_freedom)
        # What was fitted has taken its part of the noise with it, in the band that the estimate reads.
        size = np.maximum(smoothed * np.maximum(freedom / remainder, 1.0), spectra.variances(piece, columns))
        return cls(size, 2.0 * size**2 / remainder)


def _together(parts: Sequence[_Variance]) -> tuple[Floats, Floats]:
    """Return variances and their degrees of freedom of estimates that are sums over independent pieces."""
    size = np.sum([part.size for part in parts], axis=0)
    spread = np.sum([part.spread for part in parts], axis=0)
    freedom = 2.0 * size**2 / np.maximum(spread, np.finfo(float).tiny)
    return size, np.maximum(freedom, TRUST.least_freedom)


RECORD, PORTION, WINDOW_LENGTH = "record", "portion", "window"
_NAMES = ("half", "quarter")


@dataclass(frozen=True)
class View:
    """Parameters estimated in several groups."""

    kind: str  # by what
    labels: tuple[str, ...]  # of the groups
    found: tuple[Estimates, ...]  # of each group
    sizes: Floats  # of the numbers of the common fit, without sign, shape (n_free,)
    # For groups that share samples, such as windows of each length: difference of the last from the first.
    # Else None.
    apart: Estimates | None = None
    is_tested: bool = True  # false where the groups are those of another view

    def of(self, index: int) -> tuple[NDArray[np.intp], Floats, Floats, Floats]:
        """Return which groups determine a parameter alone, and its shifts, variances and degrees of freedom in them."""
        shifts, variances, freedom = (
            np.array([getattr(estimate, name)[index] for estimate in self.found])
            for name in ("shifts", "variances", "freedom")
        )
        errors = np.sqrt(variances)
        reported = np.isfinite(errors) & (errors > 0.0)
        if np.any(reported):
            reported &= (errors <= TRUST.unsure * np.min(errors[reported])) | (
                errors < POORLY_KNOWN * self.sizes[index]
            )
        known = np.flatnonzero(reported)
        return known, shifts[known], variances[known], freedom[known]

    def widened(self, factors: Floats) -> View:
        """Return the view with standard errors of each number larger by a factor, shape (n_free,)."""

        def wider(estimate: Estimates) -> Estimates:
            return replace(estimate, variances=estimate.variances * factors**2)

        apart = None if self.apart is None else wider(self.apart)
        return replace(self, found=tuple(map(wider, self.found)), apart=apart)


def views(of: Pieces, records: Sequence[str], orders: Sequence[Order]) -> dict[str, View]:
    """Return every view that the records allow, by its kind."""
    made: dict[str, View] = {}
    spectra = NoiseSpectra.of(of.whole)
    if len(records) > 1:
        made[RECORD] = _by_record(of, records, spectra)
        for order in orders:
            if order.pattern is not Pattern.TIME:
                made[order.name] = _by_level(made[RECORD], order)
    if of.cut:
        if of.portions > 1:
            made[PORTION] = _portions(of)
        made[WINDOW_LENGTH] = _lengths(of, spectra)
    return made


def _by_record(of: Pieces, records: Sequence[str], spectra: NoiseSpectra) -> View:
    parts = [[piece for piece in of.whole if piece.record == name] for name in records]
    return View(RECORD, tuple(records), _of_each(of, parts, spectra), np.abs(of.values))


def _by_level(alone: View, order: Order) -> View:
    """Return the means of the estimates of single records by level, weighted by their errors."""
    levels = sorted(set(order.levels.values()))
    own = [
        [one for name, one in zip(alone.labels, alone.found, strict=True) if order.levels[name] == level]
        for level in levels
    ]
    return View(
        order.name,
        tuple(f"{level:.3g} {order.unit}".strip() for level in levels),
        tuple(map(mean, own)),
        alone.sizes,
        # One record at each level is the view by record once more.
        is_tested=len(levels) < len(order.levels),
    )


def _portions(of: Pieces) -> View:
    count = of.portions
    # The residual of a common parameter in a record along which it changes is not noise of its parts.
    spectra = NoiseSpectra.of(of.cut[count])
    parts = [[piece for piece in of.cut[count] if piece.place[0] == i] for i in range(count)]
    labels = tuple(f"{_NAMES[TRUST.windows.index(count)]} {i + 1}" for i in range(count))
    return View(PORTION, labels, _of_each(of, parts, spectra), np.abs(of.values))


def _lengths(of: Pieces, spectra: NoiseSpectra) -> View:
    counts = sorted(of.cut)
    groups = [of.whole, *(of.cut[count] for count in counts)]
    kept = told_by_most(of, groups)
    whole, *cut = (estimates(of, group, spectra, kept) for group in groups)
    apart = [beyond(of, of.cut[count], spectra, kept) for count in counts]
    moved = (replace(own, shifts=further.shifts) for own, further in zip(cut, apart, strict=True))
    found = (replace(whole, shifts=np.zeros_like(whole.shifts)), *moved)
    labels = ("whole", *(_NAMES[TRUST.windows.index(count)] for count in counts))
    return View(WINDOW_LENGTH, labels, found, np.abs(of.values), apart[-1])


def _of_each(of: Pieces, parts: Sequence[Sequence[Piece]], spectra: NoiseSpectra) -> tuple[Estimates, ...]:
    kept = told_by_most(of, parts)
    return tuple(estimates(of, part, spectra, kept) for part in parts)
