"""Noise spectrum of each record from an autoregressive model, which can resolve a resonance.

An average over neighboring lines of a short record is wider than the resonance, where a disturbance is strongest, and so
underestimates the uncertainty there.

References
----------
As of `rigsight.diagnose.noise.innovations`. L. Ljung, *System Identification* (Prentice Hall 1999), chapter 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from rigsight.diagnose.noise.innovations import whitening_filter
from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.pieces import Piece, pseudo_inverse

Floats = NDArray[np.float64]


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
