"""Frequency response of a structure at one amplitude: from the measured sweep, or from steady sines.

The steady response is that of harmonic balance with all harmonics: each sine is simulated until it repeats, and the first
harmonic of the response is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.errors import InputError, check_in_range, check_option
from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis.spectral_ratio import SpectralRatio
from rigsight.records.record import Record
from rigsight.simulate import Structure, record_input, simulate_sets
from rigsight.simulate.input_hold import HeldInput, hold_motion

Estimator = Callable[[Record], FrequencyResponse]

_SAMPLES_PER_CYCLE = 48
_KEPT_CYCLES = 2
_FEWEST_CYCLES = 4
_MOST_CYCLES = 80
_SETTLED = 5.0
"""Time constants of the linear rig after which a transient is gone (0.7 %)."""
_STEP = 0.35
"""Longest integration step in radians of the stiffest set's natural frequency."""
_SHORTER = (4, 16)
"""Factors on the substeps for sets that ran away; a search over sweeps does without, because most of them deserve it."""
_SMALLEST = 1e-300


class MeasuredResponse(Protocol):
    """A measured frequency response with what is needed to predict it."""

    @property
    def measured(self) -> FrequencyResponse:
        """The measured response."""

    @property
    def amplitude(self) -> float:
        """Amplitude of the input."""

    def check(self, structure: Structure) -> None:
        """Raise InputError if a structure cannot answer with these signals."""

    def predicted(
        self, structure: Structure, p: NDArray[np.float64], substeps: int, quick: bool
    ) -> NDArray[np.complex128]:
        """Return the responses of parameter sets (n_parameters, n_sets), shape (n_frequencies, n_sets)."""


@dataclass(frozen=True, eq=False)
class SweptResponse:
    """A frequency response estimated from a sweep; the same sweep is simulated and the same estimator used.

    Attributes
    ----------
    measured
        The response, at frequencies worth fitting (see `FrequencyResponse.at`).
    excitation
        Record with the input; its outputs are not read.
    estimator
        Makes a frequency response of a record, as `measured` was made. None stands for `SpectralRatio` at the measured
        frequencies, which is also what a search uses, because it is linear in the response.
    """

    measured: FrequencyResponse
    excitation: Record
    estimator: Estimator | None = None

    @property
    def amplitude(self) -> float:
        """Largest deviation of the input from its mean."""
        source = self.excitation[self.measured.source]
        return float(np.max(np.abs(source - np.mean(source))))

    @cached_property
    def _ratio(self) -> SpectralRatio:
        return SpectralRatio(self.measured.source, self.measured.response, self.measured.omega)

    @cached_property
    def _rows(self) -> NDArray[np.float64]:
        return self._ratio.rows(self.excitation)

    def check(self, structure: Structure) -> None:
        """Raise InputError if a structure cannot answer with these signals."""
        _check_signals(structure, self.measured)
        check_option("The source", self.measured.source, self.excitation.signals)

    def predicted(
        self, structure: Structure, p: NDArray[np.float64], substeps: int, quick: bool
    ) -> NDArray[np.complex128]:
        """Return the responses of parameter sets (n_parameters, n_sets), shape (n_frequencies, n_sets)."""
        held = record_input(structure, self.excitation)
        n = self.excitation.n_samples
        rest = _rest(structure, p)
        outputs = _stable(structure, held, p, rest, n, substeps, () if quick else _SHORTER)[
            :, _output(structure, self.measured)
        ]
        if quick or self.estimator is None:
            with np.errstate(invalid="ignore", over="ignore"):
                real, imaginary = np.split(self._rows @ outputs, 2)
            return np.asarray(real + 1j * imaginary)
        return np.column_stack([self._estimated(output) for output in outputs.T])

    def _estimated(self, output: NDArray[np.float64]) -> NDArray[np.complex128]:
        assert self.estimator is not None
        if not np.all(np.isfinite(output)):
            return np.full(self.measured.omega.size, np.nan, dtype=np.complex128)
        found = self.estimator(self.excitation.with_signals(**{self.measured.response: output}))
        if np.array_equal(found.omega, self.measured.omega):
            return found.values
        first, last = self.measured.omega[[0, -1]]
        if found.omega[0] > first * (1.0 + 1e-9) or found.omega[-1] < last * (1.0 - 1e-9):
            raise InputError(
                f"The estimator covers {found.omega[0]:.4g} to {found.omega[-1]:.4g} rad/s and the measured response from "
                f"{first:.4g} to {last:.4g} rad/s: cut the measured response with band()."
            )
        level = np.interp(self.measured.omega, found.omega, np.log(np.maximum(found.magnitude, _SMALLEST)))
        phase = np.interp(self.measured.omega, found.omega, found.phase)
        return np.asarray(np.exp(level + 1j * phase))


@dataclass(frozen=True, eq=False)
class SteadyResponse:
    """A frequency response measured with steady sines of one amplitude, one frequency after the other.

    Attributes
    ----------
    measured
        First harmonic of the response over the input.
    amplitude
        Amplitude of the sines, in the unit of the input.
    """

    measured: FrequencyResponse
    amplitude: float

    def check(self, structure: Structure) -> None:
        """Raise InputError if a structure cannot answer with these signals."""
        _check_signals(structure, self.measured)
        check_in_range("The amplitude", self.amplitude, np.nextafter(0.0, 1.0), np.finfo(float).max)

    def predicted(
        self,
        structure: Structure,
        p: NDArray[np.float64],
        substeps: int = 1,
        quick: bool = False,
    ) -> NDArray[np.complex128]:
        """Return the responses of parameter sets (n_parameters, n_sets), shape (n_frequencies, n_sets)."""
        stiffness, inertia, damping = (
            _evaluated(structure, expression, p)
            for expression in (
                structure.rig.motion.stiffness,
                structure.rig.motion.inertia,
                structure.rig.motion.damping,
            )
        )
        fastest = float(np.sqrt(np.max(stiffness / inertia)) + np.max(np.abs(damping) / inertia))
        slowest = _SETTLED * 2.0 * float(np.max(inertia / np.maximum(damping, _SMALLEST)))
        index, rest = _output(structure, self.measured), _rest(structure, p)
        rows = []
        for omega in self.measured.omega:
            wished = slowest * omega / (2.0 * np.pi) + _KEPT_CYCLES
            cycles = int(np.clip(np.ceil(wished), _FEWEST_CYCLES, _MOST_CYCLES // (2 if quick else 1)))
            held, dt = _sine(self.amplitude, float(omega), cycles)
            steps = max(substeps, int(np.ceil(fastest * dt / _STEP)))
            n = cycles * _SAMPLES_PER_CYCLE
            output = _stable(structure, held, p, rest, n, steps, _SHORTER[:1] if quick else _SHORTER)[
                :, index
            ]
            kept = output[-_KEPT_CYCLES * _SAMPLES_PER_CYCLE :]
            turn = np.exp(-2j * np.pi * np.arange(kept.shape[0]) / _SAMPLES_PER_CYCLE)
            with np.errstate(invalid="ignore", over="ignore"):
                # sin(x) = Im exp(jx): the sine's own first harmonic is -j times half its amplitude.
                rows.append(2j * np.mean(turn[:, None] * kept, axis=0) / self.amplitude)
        return np.array(rows)


def _stable(
    structure: Structure,
    held: HeldInput,
    p: NDArray[np.float64],
    rest: NDArray[np.float64],
    n_samples: int,
    substeps: int,
    shorter: tuple[int, ...],
) -> NDArray[np.float64]:
    """Simulate; sets that ran away are simulated again with shorter steps, because stiff loops do where they should not."""
    outputs = simulate_sets(structure, held, p, rest, n_samples, substeps)
    for factor in shorter:
        lost = ~np.all(np.isfinite(outputs), axis=(0, 1))
        if not lost.any():
            break
        again = simulate_sets(structure, held, p[:, lost], rest[:, lost], n_samples, factor * substeps)
        outputs[:, :, lost] = again
    return outputs


def _sine(amplitude: float, omega: float, cycles: int) -> tuple[HeldInput, float]:
    phase = 2.0 * np.pi * np.arange(cycles * _SAMPLES_PER_CYCLE) / _SAMPLES_PER_CYCLE
    dt = 2.0 * np.pi / (omega * _SAMPLES_PER_CYCLE)
    return hold_motion(amplitude * np.sin(phase), amplitude * omega * np.cos(phase), dt), dt


def _check_signals(structure: Structure, measured: FrequencyResponse) -> None:
    rig = structure.rig
    if not rig.is_driven:
        raise InputError(
            f"Frequency responses are calibrated on a rig whose input moves a mass; '{rig.name}' prescribes the motion. "
            "Calibrate to its records instead."
        )
    check_option("The source", measured.source, [signal.name for signal in rig.inputs])
    check_option("The response", measured.response, [signal.name for signal in rig.outputs])
    if not measured.magnitude.all():
        raise InputError(
            f"{measured.source} -> {measured.response} is zero at some frequency: leave that frequency out."
        )


def _output(structure: Structure, measured: FrequencyResponse) -> int:
    return [signal.name for signal in structure.rig.outputs].index(measured.response)


def _rest(structure: Structure, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states at the rest position without memory, shape (n_states, n_sets)."""
    states = np.zeros((len(structure.states), p.shape[1]))
    states[0] = _evaluated(structure, structure.rig.motion.rest, p)
    return states


def _evaluated(
    structure: Structure, expression: sp.Expr | None, p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return an expression of the rig's declaration for every set, shape (n_sets,)."""
    assert expression is not None
    symbols = sorted(expression.free_symbols, key=lambda symbol: symbol.name)
    values = [p[structure.names.index(symbol.name)] for symbol in symbols]
    return np.broadcast_to(
        np.asarray(sp.lambdify(symbols, expression)(*values), dtype=np.float64), (p.shape[1],)
    )
