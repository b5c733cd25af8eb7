"""Frequency response of a sweep at chosen frequencies, and the peak and break frequency of a response."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.errors import InputError
from rigsight.frequency import FrequencyResponse, hold_response
from rigsight.frequency.signal_pair import pair_unit
from rigsight.identify.transfer.transfer_function import fit_frequency_response
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


@dataclass(frozen=True)
class Peak:
    """The highest point of a magnitude."""

    omega: float  # angular frequency [rad/s]
    magnitude: float  # in the unit of the response
    is_resonance: bool  # False at the first or last line of the band: the response has no peak in it


def peak(response: FrequencyResponse) -> Peak:
    """Return the highest point, by a parabola through the logarithms of three points if it is inside the band."""
    level = np.log(np.maximum(response.magnitude, 1e-300))
    top = int(np.argmax(level))
    if not 0 < top < level.size - 1:
        return Peak(float(response.omega[top]), float(response.magnitude[top]), is_resonance=False)
    place = np.log(response.omega[top - 1 : top + 2] / response.omega[top])
    curvature, slope, height = np.polyfit(place, level[top - 1 : top + 2], 2)
    shift = float(np.clip(-0.5 * slope / curvature, place[0], place[2])) if curvature < 0.0 else 0.0
    return Peak(
        float(response.omega[top] * np.exp(shift)),
        float(np.exp(height + slope * shift + curvature * shift**2)),
        is_resonance=True,
    )


def break_frequency(response: FrequencyResponse) -> float:
    """Return the break frequency [rad/s], at which the phase first passes -90 degrees; refused if it does not within the band.

    The thesis defines omega_b by the PT2 (2.9), whose phase is "reaching -90 degrees at the break frequency" (section 2.2.2).
    Chapter 6 gives the break frequency of hysteretic simulations without stating how it is determined for a curve that is not a
    PT2. This definition reproduces its statements: compared with the PT2 of Table 4.1 at 1 A, set B has the right break frequency
    (0.4 %) and half the peak, and that of set P is too low (10 %). From the magnitude, that of set B would be 4 % too high.
    For responses whose phase is changed by delays or lags see `fitted_break_frequency`.
    """
    phase = response.phase
    phase = phase - 2.0 * np.pi * np.round(phase[0] / (2.0 * np.pi))
    below = np.flatnonzero(phase <= -0.5 * np.pi)
    if below.size == 0 or below[0] == 0:
        raise InputError(
            f"The phase of {response.source} -> {response.response} does not pass -90 degrees between "
            f"{response.omega[0]:.4g} and {response.omega[-1]:.4g} rad/s: there is no natural frequency to read off."
        )
    after = int(below[0])
    pair = slice(after - 1, after + 1)
    share = (phase[after - 1] + 0.5 * np.pi) / (phase[after - 1] - phase[after])
    low, high = np.log(response.omega[pair])
    return float(np.exp(low + share * (high - low)))


def fitted_break_frequency(response: FrequencyResponse) -> float:
    """Return omega_b [rad/s] of the PT2 that fits the magnitude best, with equal weights in dB, as in a fit by eye.

    This is the manual fit of section 4.4 of the thesis, which does not use the phase; delays and lags do not affect it.
    """
    found = fit_frequency_response(response, "pt2", magnitude_only=True, weighting="relative")
    if not found.success:
        raise InputError(f"The break frequency cannot be read off the magnitude: {found.message}")
    return found.values["omega_b"]
