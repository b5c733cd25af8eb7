"""Frequency response of a sweep at chosen frequencies, by an estimator that is linear in the response."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, hold_response
from rigsight.frequency.signal_pair import pair_unit
from rigsight.records.record import Floats, Record

_NEAREST = 0.75
"""Smallest width of the averaging, in distances between spectral lines."""


@dataclass(frozen=True, eq=False)
class SpectralRatio:
    """Cross spectrum over the source's spectrum, both averaged over neighboring lines with a Gaussian weight.

    The width grows with the frequency, as suits a logarithmic sweep. Because the source is known in advance, the estimator is one
    matrix that is multiplied with the response: for thousands of simulations its cost is negligible.
    """

    source: str
    response: str
    omega: Floats  # frequencies [rad/s], increasing, shape (n_frequencies,)
    width: float = 0.035  # standard deviation of the weight, relative to the frequency

    def __call__(self, record: Record) -> FrequencyResponse:
        """Return the frequency response of a record that starts at rest."""
        # For a single record, the matrix of `rows` would take a hundred times as long.
        answer = np.fft.rfft(record[self.response])
        sums = [np.sum(weights * answer[near]) for near, weights in self._weights(record)]
        values = np.array(sums) / hold_response(self.omega, record.dt, record.hold)
        return FrequencyResponse(
            omega=self.omega,
            values=values,
            source=self.source,
            response=self.response,
            unit=pair_unit(record, self.source, self.response),
            records=(record.name,),
            method=f"spectral ratio averaged over {self.width:g} of the frequency",
        )

    def rows(self, record: Record) -> Floats:
        """Return the matrix from response samples to real parts, then imaginary parts, shape (2 n_frequencies, n_samples)."""
        n = record.n_samples
        weighted = np.zeros((self.omega.size, n), dtype=np.complex128)
        for row, (near, weights) in zip(weighted, self._weights(record), strict=True):
            row[near] = weights
        # The Fourier transform of a row gives the weights of the samples: sum_k row_k Y_k = sum_i y_i fft(row)_i.
        rows = np.fft.fft(weighted, axis=1) / hold_response(self.omega, record.dt, record.hold)[:, None]
        return np.concatenate([rows.real, rows.imag])

    def _weights(self, record: Record) -> Iterator[tuple[NDArray[np.intp], NDArray[np.complex128]]]:
        """Yield, for each frequency, the spectral lines about it and their weights in the response."""
        lines = 2.0 * np.pi * np.fft.rfftfreq(record.n_samples, record.dt)
        if self.omega[-1] >= lines[-1]:
            raise InputError(
                f"Record '{record.name}' has a Nyquist frequency of {lines[-1]:.4g} rad/s, but {self.omega[-1]:.4g} rad/s is "
                f"requested: sample faster, or reduce the band."
            )
        spectrum = np.fft.rfft(record[self.source])
        for omega in self.omega:
            spread = max(self.width * omega, _NEAREST * lines[1])
            # The line at zero contains the means, which are not a response to a sweep.
            near = np.flatnonzero((np.abs(lines - omega) < 2.0 * spread) & (lines > 0.0))
            weight = np.exp(-0.5 * ((lines[near] - omega) / spread) ** 2)
            power = float(np.sum(weight * np.abs(spectrum[near]) ** 2))
            if power <= 0.0:
                raise InputError(
                    f"Record '{record.name}': '{self.source}' has no content near {omega:.4g} rad/s."
                )
            yield near, weight * np.conj(spectrum[near]) / power
