"""The plain ratio of two spectra, line by line, which still contains the free motion of the record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.frequency.frequency_response import FrequencyResponse
from rigsight.frequency.signal_pair import hold_response, line_frequencies
from rigsight.records.record import Hold, Record

_SMOOTHED = 15
"""Lines over which the noise of local bands is averaged: one more band to each side, far less than a resonance is wide."""


@dataclass(frozen=True, eq=False, kw_only=True)
class PlainRatio(FrequencyResponse):
    """Response over source at each line of a record, with independent errors.

    It is ``G + T / drive`` with the free motion T that the difference between the first and the last state of the record excites.
    A local model confuses T with the response at lines that a smooth sweep visits near the ends of a record: both are smooth
    there. T has the poles of G, so a form of G distinguishes them.

    Attributes
    ----------
    drive
        Spectrum of the source with its hold, shape (n_frequencies,).
    dt, n_samples, hold
        Sample time [s] and length of the record, and the hold of the source.
    """

    drive: NDArray[np.complex128]
    dt: float
    n_samples: int
    hold: Hold

    def free_motions(self, poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return a basis of the free motions over the drive, shape (n_frequencies, n_poles).

        Parameters
        ----------
        poles
            Poles of the form [1/s], shape (n_poles,).
        """
        return np.asarray(_free_motions(self.omega, self.dt, poles) / self.drive[:, None])

    def free_motion(self, weights: NDArray[np.float64], poles: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Return the free motion with these weights of the basis over time, without its mean, shape (n_samples,)."""
        omega = np.asarray(2.0 * np.pi * np.fft.rfftfreq(self.n_samples, self.dt)[1:], dtype=np.float64)
        lines = _free_motions(omega, self.dt, poles) @ weights
        return np.asarray(np.fft.irfft(np.append(0.0, lines), self.n_samples))


def _free_motions(
    omega: NDArray[np.float64], dt: float, poles: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return ``z^-i / A(z)`` with the sampled poles: exact for all end states, since z^-n is 1 at the lines of n samples."""
    delayed = np.exp(-1j * omega * dt)
    below = np.prod(1.0 - np.exp(poles * dt) * delayed[:, None], axis=1)
    return np.asarray(delayed[:, None] ** np.arange(poles.size) / below[:, None])


def plain_ratio(record: Record, local: FrequencyResponse, hold: Hold) -> PlainRatio:
    """Return the plain ratio at the lines of a local model of the same record, with the noise that this found.

    Parameters
    ----------
    record
        The record.
    local
        Response of its source and response by a local model, whose `line_noise` is known.
    hold
        Hold of the source between its samples.
    """
    assert local.line_noise is not None
    every = line_frequencies(record.n_samples, record.dt)
    lines = np.searchsorted(every, local.omega * (1.0 - 1e-9)) + 1
    source, response = (np.fft.rfft(record[name])[lines] for name in (local.source, local.response))
    drive = source * hold_response(local.omega, record.dt, hold)
    width = min(_SMOOTHED, lines.size)
    weights = np.ones(width)
    count = np.convolve(np.ones(lines.size), weights, mode="same")
    noise = np.convolve(local.line_noise, weights, mode="same") / count
    return PlainRatio(
        omega=local.omega,
        values=response / drive,
        source=local.source,
        response=local.response,
        unit=local.unit,
        variance=noise / np.abs(drive) ** 2,
        records=local.records,
        method=f"spectra with the noise of {local.method}",
        noise_freedom=2.0 * local.noise_freedom,
        drive=drive,
        dt=record.dt,
        n_samples=record.n_samples,
        hold=hold,
    )
