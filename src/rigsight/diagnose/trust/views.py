"""Groupings for repeated estimates: by record, amplitude or constant, portion of a record, and window length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.estimates import Estimates, NoiseSpectra, beyond, estimates, mean, told_by_most
from rigsight.diagnose.trust.patterns import Order, Pattern
from rigsight.diagnose.trust.pieces import Piece, Pieces
from rigsight.identify.information import POORLY_KNOWN
from rigsight.records.record import Floats

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

    def known(self, index: int) -> NDArray[np.intp]:
        """Return which groups determine a parameter alone."""
        errors = np.sqrt([estimate.variances[index] for estimate in self.found])
        reported = np.isfinite(errors) & (errors > 0.0)
        if np.any(reported):
            reported &= (errors <= TRUST.unsure * np.min(errors[reported])) | (
                errors < POORLY_KNOWN * self.sizes[index]
            )
        return np.flatnonzero(reported)

    def of(self, index: int) -> tuple[Floats, Floats, Floats]:
        """Return shifts, variances and degrees of freedom of a number in all groups, shape (n_groups,) each."""
        return (
            np.array([estimate.shifts[index] for estimate in self.found]),
            np.array([estimate.variances[index] for estimate in self.found]),
            np.array([estimate.freedom[index] for estimate in self.found]),
        )

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
