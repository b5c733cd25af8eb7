"""Least squares on an equation of motion in the frequency domain, weighted so that its error approaches the output error.

The equation is linear in its coefficients, so it has no local minima and is suitable for start values. A polynomial per record
accounts for the transients at its ends.

References
----------
C. K. Sanathanan and J. Koerner, "Transfer function synthesis as a ratio of two complex polynomials", IEEE Trans. Automatic
Control (1963). R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 9.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.start.linearized_responses import USABLE_BAND, response_of_hold
from rigsight.identify.start.measured_states import SIGNIFICANT_POWER
from rigsight.records.record import Floats, Record

_ITERATIONS = 20
_TRANSIENT_ORDER = 2
_EXCITED = 1e-3
_MIN_LINES = 20

Term = tuple[int, NDArray[np.complex128]]
"""Power of j omega and the spectrum that it multiplies."""


@dataclass(frozen=True)
class Spectra:
    """Spectra of one record on its informative lines, shape (n_lines,) each."""

    omega: Floats  # angular frequencies [rad/s]
    lines: NDArray[np.intp]  # indices of the lines in the full spectrum
    hold: NDArray[np.complex128]  # frequency response of the hold
    drive: NDArray[np.complex128]  # input, multiplied by the response of the hold
    response: NDArray[np.complex128]  # output


@dataclass(frozen=True)
class Solution:
    """Coefficients of the terms, and the remaining weighted error."""

    coefficients: Floats
    error: float


def spectra_of(record: Record, source: str, response: str) -> Spectra:
    """Return the spectra of a record on the lines on which input and response exceed the noise."""
    u = record[source] - np.mean(record[source])
    x = record[response] - np.mean(record[response])
    omega: Floats = 2.0 * np.pi * np.asarray(np.fft.rfftfreq(u.size, record.dt)[1:], dtype=np.float64)
    drive, spectrum = np.fft.rfft(u)[1:] / u.size, np.fft.rfft(x)[1:] / u.size
    hold = response_of_hold(record, omega)
    power = np.abs(spectrum) ** 2
    floor = np.median(power[int(0.9 * power.size) :])
    significant = (power > SIGNIFICANT_POWER * floor) & (omega < USABLE_BAND * np.pi / record.dt)
    excited = np.abs(drive) > _EXCITED * np.max(np.abs(drive))
    keep = significant & excited
    if np.count_nonzero(keep) < _MIN_LINES:
        keep = excited
    lines = np.flatnonzero(keep) + 1
    return Spectra(omega[keep], lines, hold[keep], (drive * hold)[keep], spectrum[keep])


def solve_in_frequency(
    blocks: Sequence[Spectra],
    terms: Sequence[Sequence[Term]],
    targets: Sequence[NDArray[np.complex128]],
    denominators: Sequence[NDArray[np.complex128]] | None = None,
) -> Solution:
    """Solve ``sum_i a_i (j omega)^order_i F_i = target + transient`` over all records for the real a_i."""
    top = max(float(np.max(block.omega)) for block in blocks)
    n_terms, n_transient = len(terms[0]), _TRANSIENT_ORDER + 1
    weights = list(denominators or [np.ones_like(block.response) for block in blocks])
    solution = np.zeros(n_terms + n_transient * len(blocks))
    error = float("inf")
    for _ in range(1 if denominators else _ITERATIONS):
        previous = solution
        solution, error = _weighted_solution(blocks, terms, targets, weights, top)
        if np.allclose(solution[:n_terms], previous[:n_terms], rtol=1e-6):
            break
        if not denominators:
            weights = [
                _own_denominator(block, own, solution, top) for block, own in zip(blocks, terms, strict=True)
            ]
    orders = np.array([order for order, _ in terms[0]])
    return Solution(solution[:n_terms] / top**orders, error)


def _weighted_solution(
    blocks: Sequence[Spectra],
    terms: Sequence[Sequence[Term]],
    targets: Sequence[NDArray[np.complex128]],
    weights: Sequence[NDArray[np.complex128]],
    top: float,
) -> tuple[Floats, float]:
    n_terms, n_transient = len(terms[0]), _TRANSIENT_ORDER + 1
    n_columns = n_terms + n_transient * len(blocks)
    normal, right, energy = np.zeros((n_columns, n_columns)), np.zeros(n_columns), 0.0
    for index, (block, own, target, weight) in enumerate(zip(blocks, terms, targets, weights, strict=True)):
        s = 1j * block.omega / top
        columns = np.zeros((block.omega.size, n_columns), dtype=np.complex128)
        for i, (order, spectrum) in enumerate(own):
            columns[:, i] = s**order * spectrum
        first = n_terms + index * n_transient
        for power in range(n_transient):
            columns[:, first + power] = -(s**power)
        weighted, goal = columns / weight[:, None], target / weight
        normal += np.real(weighted.conj().T @ weighted)
        right += np.real(weighted.conj().T @ goal)
        energy += float(np.sum(np.abs(goal) ** 2))
    # A term that is zero in all records, such as a stop that is never reached, has no scale, and gets no coefficient.
    size = np.sqrt(np.where(np.diag(normal) > 0.0, np.diag(normal), 1.0))
    scaled = np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=1e-14)[0]
    solution = scaled / size
    return solution, float(np.sqrt(max(energy - float(solution @ right), 0.0)))


def _own_denominator(
    block: Spectra, terms: Sequence[Term], solution: Floats, top: float
) -> NDArray[np.complex128]:
    s = 1j * block.omega / top
    value = np.zeros_like(block.response)
    for i, (order, spectrum) in enumerate(terms):
        if spectrum is block.response:
            value = value + solution[i] * s**order
    return np.where(np.abs(value) > 0.0, value, 1.0)
