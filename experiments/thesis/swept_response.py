"""Which frequency response does a model give where that of a measured sweep is known? The same sweep is simulated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from rigsight.errors import InputError, check_option
from rigsight.frequency import FrequencyResponse
from rigsight.identify.hysteresis import SpectralRatio
from rigsight.records import Record
from rigsight.simulate import Structure, record_input, simulate_sets
from rigsight.simulate.input_hold import HeldInput

_SHORTER = (4, 16)
"""Factors on the substeps for sets that ran away; a search does without, because most of them deserve it."""


@dataclass(frozen=True, eq=False)
class SweptResponse:
    """A frequency response that `SpectralRatio` made of a sweep; models answer the same sweep, read by the same estimator.

    Attributes
    ----------
    measured
        The response, at frequencies worth fitting.
    excitation
        Record with the input; its outputs are not read.
    """

    measured: FrequencyResponse
    excitation: Record

    @property
    def amplitude(self) -> float:
        """Largest deviation of the input from its mean."""
        source = self.excitation[self.measured.source]
        return float(np.max(np.abs(source - np.mean(source))))

    @cached_property
    def _rows(self) -> NDArray[np.float64]:
        ratio = SpectralRatio(self.measured.source, self.measured.response, self.measured.omega)
        return ratio.rows(self.excitation)

    def check(self, structure: Structure) -> None:
        """Raise InputError if a structure cannot answer with these signals."""
        rig, measured = structure.rig, self.measured
        if not rig.is_driven:
            raise InputError(
                f"Frequency responses are calibrated on a rig whose input moves a mass; '{rig.name}' prescribes the motion. "
                "Calibrate to its records instead."
            )
        check_option("The source", measured.source, [signal.name for signal in rig.inputs])
        check_option("The response", measured.response, [signal.name for signal in rig.outputs])
        check_option("The source", measured.source, self.excitation.signals)
        if not measured.magnitude.all():
            raise InputError(
                f"{measured.source} -> {measured.response} is zero at some frequency: leave that frequency out."
            )

    def predicted(
        self, structure: Structure, p: NDArray[np.float64], substeps: int, quick: bool
    ) -> NDArray[np.complex128]:
        """Return the responses of parameter sets (n_parameters, n_sets), shape (n_frequencies, n_sets)."""
        held = record_input(structure, self.excitation)
        shorter = () if quick else _SHORTER
        outputs = _stable(
            structure, held, p, _rest(structure, p), self.excitation.n_samples, substeps, shorter
        )
        index = [signal.name for signal in structure.rig.outputs].index(self.measured.response)
        with np.errstate(invalid="ignore", over="ignore"):
            real, imaginary = np.split(self._rows @ outputs[:, index], 2)
        return np.asarray(real + 1j * imaginary)


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


def _rest(structure: Structure, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states at the rest position without memory, shape (n_states, n_sets)."""
    states = np.zeros((len(structure.states), p.shape[1]))
    rest = structure.rig.motion.rest
    symbols = sorted(rest.free_symbols, key=lambda symbol: symbol.name)
    states[0] = sp.lambdify(symbols, rest)(*(p[structure.names.index(symbol.name)] for symbol in symbols))
    return states
