"""Least squares on an equation of motion in the frequency domain, weighted so that its error approaches the output error.

The equation is linear in its coefficients, so it has no local minima and is suitable for start values. A polynomial per record
accounts for the transients at its ends.

Effects: a grid over their nonlinear parameters, linear regression for the rest. The measured motion replaces the simulated one,
so that torque, play and drive of an effect become known signals. Effects with states, and delays, have no such signal and get no
start values.

References
----------
C. K. Sanathanan and J. Koerner, "Transfer function synthesis as a ratio of two complex polynomials", IEEE Trans. Automatic
Control (1963). R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapter 9.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.effects import Effect
from rigsight.effects import symbols as canonical
from rigsight.effects.symbols import derivative
from rigsight.identify.start.linearized_responses import USABLE_BAND, response_of_hold
from rigsight.identify.start.measured_states import SIGNIFICANT_POWER
from rigsight.parameters import Parameter
from rigsight.records.record import Floats, Record
from rigsight.rigs import Rig, evaluated
from rigsight.simulate.prescribed_motion import smooth_motion
from rigsight.units import characteristic_value

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

    def of(self, signal: Floats) -> NDArray[np.complex128]:
        """Return the spectrum of another signal of the record, shape (n_samples,), on the same lines."""
        centered = signal - np.mean(signal)
        return np.asarray(np.fft.rfft(centered)[self.lines] / signal.size)


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


_GRID = 12
_GRID_OF_TWO = 6
"""Grid points of each of two nonlinear parameters: 36 in all, three times as many as for one."""
_SIGNALS = (canonical.x, canonical.v, canonical.u, canonical.position, canonical.load)
_LOWEST_SHARE = 0.01


@dataclass(frozen=True)
class _Motion:
    """Measured signals of a record about the rest position, in the order of `_SIGNALS`."""

    spectra: Spectra
    signals: tuple[Floats, ...]


class EffectRegression:
    """Regression of effects on the records of a driven rig, about its constants and parameters fitted without the effect."""

    def __init__(
        self, rig: Rig, records: Sequence[Record], values: Mapping[str, float], scales: Mapping[str, float]
    ) -> None:
        self._rig = rig
        self._values = dict(values)
        self._scales = scales
        self._gain = self._number(rig.motion.drive_gain)
        stiffness = self._number(rig.motion.stiffness)
        self._spring = stiffness > 0.0
        rest = self._number(rig.motion.rest)
        source, response = rig.inputs[0].name, rig.outputs[0].name
        self._motions = []
        for record in records:
            x, v = smooth_motion(record[response], record.dt)
            spectra = spectra_of(record, source, response)
            if spectra.omega.size == 0:
                continue  # the input is at rest in this stretch
            load = self._gain * record[source] + stiffness * (x - rest)
            self._motions.append(_Motion(spectra, (x - rest, v, record[source], x, load)))
        inertia, damping = self._number(rig.motion.inertia), self._number(rig.motion.damping)
        self._denominators = [
            stiffness - inertia * m.spectra.omega**2 + 1j * damping * m.spectra.omega for m in self._motions
        ]

    def _number(self, expression: sp.Expr | None) -> float:
        return evaluated(expression, self._values)

    def start(self, effect: Effect) -> dict[str, float] | None:
        """Return start values of rig and effect parameters, None if the effect is not a function of measured signals."""
        if effect.states or effect.spring is not None or not self._motions:
            return None
        if effect.torque is None and effect.deflection is None and effect.drive is None:
            return None
        # The cost has as many minima over a wave number as there are waves in the motion; its start is found in another way.
        if (
            effect.wave_number is not None
            or effect.reads(canonical.t)
            or effect.reads(canonical.acceleration)
        ):
            return None
        fitted = [p for p in effect.parameters if p.fitted]
        linear = [p for p in fitted if effect.torque is not None and _is_linear(effect.torque, p)]
        inner = [p for p in fitted if p not in linear]
        held = {
            p.name: p.held_at(characteristic_value(p.dimension, self._scales))
            for p in effect.parameters
            if not p.fitted
        }
        best: dict[str, float] | None = None
        lowest = float("inf")
        for grid in self._grid(inner):
            values = {**held, **grid}
            found, error = self._regressed(effect, linear, values)
            if found is not None and error < lowest:
                best, lowest = {**found, **values}, error
        return best

    def _grid(self, inner: Sequence[Parameter]) -> Iterator[dict[str, float]]:
        axes = []
        points = _GRID if len(inner) < 2 else _GRID_OF_TWO
        for parameter in inner:
            size = characteristic_value(parameter.dimension, self._scales)
            low, high = parameter.search
            if parameter.logarithmic or high > 1.0:
                shares = np.geomspace(max(low, _LOWEST_SHARE), min(high, 3.0), points)
            else:
                shares = np.linspace(low, high, points + 2)[1:-1]
            axes.append([float(share * size) for share in shares])
        for combination in itertools.product(*axes):
            yield dict(zip((p.name for p in inner), combination, strict=True))

    def _regressed(
        self, effect: Effect, linear: Sequence[Parameter], inner: Mapping[str, float]
    ) -> tuple[dict[str, float] | None, float]:
        torques = [_function(derivative(effect.torque, sp.Symbol(p.name, real=True)), inner) for p in linear]
        deflection = _function(effect.deflection, inner) if effect.deflection is not None else None
        drive = _function(effect.drive, inner) if effect.drive is not None else None
        terms: list[list[Term]] = []
        targets = []
        for motion in self._motions:
            spectra = motion.spectra
            own: list[Term] = [(2, spectra.response), (1, spectra.response)]
            if self._spring:
                own.append((0, spectra.response if deflection is None else spectra.of(deflection(motion))))
            own += [(0, spectra.of(torque(motion))) for torque in torques]
            terms.append(own)
            known = spectra.drive if drive is None else spectra.of(drive(motion)) * spectra.hold
            targets.append(self._gain * known)
        blocks = [motion.spectra for motion in self._motions]
        solution = solve_in_frequency(blocks, terms, targets, self._denominators)
        coefficients = list(solution.coefficients)
        names = [str(self._rig.motion.inertia), str(self._rig.motion.damping)]
        names += [str(self._rig.motion.stiffness)] if self._spring else []
        found = dict(zip([*names, *(p.name for p in linear)], map(float, coefficients), strict=True))
        if found[names[0]] <= 0.0 or (self._spring and found[names[2]] <= 0.0):
            return None, float("inf")
        found[names[1]] = max(found[names[1]], 0.05 * self._number(self._rig.motion.damping))
        return found, solution.error


def _is_linear(expression: sp.Expr, parameter: Parameter) -> bool:
    symbol = sp.Symbol(parameter.name, real=True)
    return not derivative(expression, symbol).has(symbol)


def _function(expression: sp.Expr, inner: Mapping[str, float]):  # type: ignore[no-untyped-def]
    """Return the expression as a function of the measured signals of a record."""
    numbers = {sp.Symbol(name, real=True): value for name, value in inner.items()}
    plain = expression.replace(canonical.positive_part, lambda e: (e + sp.Abs(e)) / 2).subs(numbers)
    compiled = sp.lambdify(_SIGNALS, plain, "numpy", cse=True)

    def evaluate(motion: _Motion) -> Floats:
        return np.broadcast_to(compiled(*motion.signals), motion.signals[0].shape).astype(np.float64)

    return evaluate
