"""By what is a number estimated again? By record, by level of what was set, by portion of a record, in shorter windows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.estimates import Estimates, beyond, estimates
from rigsight.diagnose.trust.orders import Order
from rigsight.diagnose.trust.patterns import Pattern
from rigsight.diagnose.trust.pieces import Pieces
from rigsight.diagnose.trust.spectra import NoiseSpectra
from rigsight.identify.undetermined import POORLY_KNOWN

Floats = NDArray[np.float64]

RECORD, PORTION, WINDOW_LENGTH = "record", "portion", "window"
_NAMES = ("half", "quarter")


@dataclass(frozen=True)
class View:
    """Numbers estimated in several groups.

    Attributes
    ----------
    kind
        By what.
    labels
        Of the groups.
    found
        Of each group.
    sizes
        Of the numbers of the common fit, without sign, shape (n_free,).
    apart
        Where groups share samples, as windows of each length do: how the last differs from the first. Else None.
    is_tested
        False where the groups are those of another view.
    """

    kind: str
    labels: tuple[str, ...]
    found: tuple[Estimates, ...]
    sizes: Floats
    apart: Estimates | None = None
    is_tested: bool = True

    def known(self, index: int) -> NDArray[np.intp]:
        """Return which groups determine a number by themselves."""
        errors = np.sqrt([estimate.variances[index] for estimate in self.found])
        told = np.isfinite(errors) & (errors > 0.0)
        if np.any(told):
            told &= (errors <= TRUST.unsure * np.min(errors[told])) | (
                errors < POORLY_KNOWN * self.sizes[index]
            )
        return np.flatnonzero(told)

    def of(self, index: int) -> tuple[Floats, Floats, Floats]:
        """Return shifts, variances and degrees of freedom of a number in all groups, shape (n_groups,) each."""
        return (
            np.array([estimate.shifts[index] for estimate in self.found]),
            np.array([estimate.variances[index] for estimate in self.found]),
            np.array([estimate.freedom[index] for estimate in self.found]),
        )


def views(of: Pieces, records: Sequence[str], orders: Sequence[Order]) -> dict[str, View]:
    """Return every view that the records allow, by its kind.

    Parameters
    ----------
    of
        What records and windows say.
    records
        Names of the records in the order of the campaign.
    orders
        By what records differ.
    """
    made: dict[str, View] = {}
    spectra = NoiseSpectra.of(of.whole)
    if len(records) > 1:
        made[RECORD] = _grouped(of, spectra, RECORD, {name: [name] for name in records})
        for order in orders:
            if order.pattern is not Pattern.TIME:
                made[order.name] = _by_level(of, spectra, order)
    if of.cut:
        if of.portions > 1:
            made[PORTION] = _portions(of, spectra)
        made[WINDOW_LENGTH] = _lengths(of, spectra)
    return made


def _grouped(
    of: Pieces, spectra: NoiseSpectra, kind: str, groups: Mapping[str, Sequence[str]], is_tested: bool = True
) -> View:
    return View(
        kind,
        tuple(groups),
        tuple(
            estimates(of, [p for p in of.whole if p.record in members], spectra)
            for members in groups.values()
        ),
        np.abs(of.values),
        is_tested=is_tested,
    )


def _by_level(of: Pieces, spectra: NoiseSpectra, order: Order) -> View:
    levels = sorted(set(order.levels.values()))
    groups = {
        f"{level:.3g} {order.unit}".strip(): [name for name, own in order.levels.items() if own == level]
        for level in levels
    }
    # One record at each level is the view by record once more.
    return _grouped(of, spectra, order.name, groups, len(groups) < len(order.levels))


def _portions(of: Pieces, spectra: NoiseSpectra) -> View:
    count = of.portions
    parts = [[piece for piece in of.cut[count] if piece.place[0] == i] for i in range(count)]
    labels = tuple(f"{_NAMES[TRUST.windows.index(count)]} {i + 1}" for i in range(count))
    return View(PORTION, labels, tuple(estimates(of, part, spectra) for part in parts), np.abs(of.values))


def _lengths(of: Pieces, spectra: NoiseSpectra) -> View:
    counts, whole = sorted(of.cut), estimates(of, of.whole, spectra)
    apart = [beyond(of, of.cut[count], spectra) for count in counts]
    cut = [
        replace(estimates(of, of.cut[count], spectra), shifts=further.shifts)
        for count, further in zip(counts, apart, strict=True)
    ]
    found = (replace(whole, shifts=np.zeros_like(whole.shifts)), *cut)
    labels = ("whole", *(_NAMES[TRUST.windows.index(count)] for count in counts))
    return View(WINDOW_LENGTH, labels, found, np.abs(of.values), apart[-1])
