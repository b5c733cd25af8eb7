"""Error of the linearization of a rig relative to the spectra of its records: frequency responses to all inputs, with transients.

``j omega X = A X + B U + (x(0) - x(T))`` holds for the Fourier integrals over a record with any states at its ends; the
difference is estimated for each record by linear least squares. This needs no periodicity, no stability and no input: a free
decay consists of these end terms alone.

References
----------
R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 6 and 9.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.rig_equations import RigEquations
from rigsight.identify.start.measured_states import SIGNIFICANT_POWER
from rigsight.records.record import Floats, Record

Complexes = NDArray[np.complex128]

USABLE_BAND = 0.8
"""Share of the band below half the sampling rate in which what an input does between samples hardly matters."""
_MOST_LINES = 200
"""Number of lines of all records together, evenly chosen among the informative ones."""
_RELATIVE_ERROR = 0.05
"""Relative error of the linearization assumed for each line, so that weak lines count as much as strong ones and a resonance at a
wrong frequency does not dominate."""


@dataclass(frozen=True)
class _Lines:
    """Spectra of one record: of inputs (3 n_inputs, n_lines), of its sensors (n_seen, n_lines), and their weights."""

    omega: Floats
    inputs: Complexes
    shown: Complexes
    weights: Floats
    seen: list[int]
    p: Floats
    mean_inputs: Floats


class LinearizedResponses:
    """The error of the spectra of records as a function of a rig's free parameters, the values of all others being known.

    The rig moves about the states `middle` in each record, shape (n_states,) each.
    """

    def __init__(
        self,
        equations: RigEquations,
        records: Sequence[Record],
        values: Mapping[str, float],
        free: Sequence[str],
        middle: Sequence[Floats],
    ) -> None:
        self._equations = equations
        self._columns = [equations.structure.names.index(name) for name in free]
        unknown = dict.fromkeys(free, 1.0)
        most = max(10, _MOST_LINES // len(records))
        self._records = [
            _lines(equations, record, equations.parameters({**unknown, **values}, record), most)
            for record in records
        ]
        self._middle = list(middle)

    def errors(self, values: Floats) -> Floats:
        """Return the weighted errors for values of the free parameters, shape (n_errors,)."""
        found = []
        for record, middle in zip(self._records, self._middle, strict=True):
            p = record.p.copy()
            p[self._columns] = values
            with np.errstate(all="ignore"):
                found.append(self._remainder(record, middle, p))
        return np.nan_to_num(np.concatenate(found), nan=1e6, posinf=1e6, neginf=-1e6)

    def _remainder(self, record: _Lines, middle: Floats, p: Floats) -> Floats:
        a, b, c, d = self._matrices(middle, record.mean_inputs, p)
        n = a.shape[0]
        try:
            inverse = np.linalg.inv(1j * record.omega[:, None, None] * np.eye(n) - a)
        except np.linalg.LinAlgError:
            return np.full(2 * record.shown.size, np.nan)
        through = c[record.seen] @ inverse
        driven = (through @ (b @ record.inputs).T[:, :, None])[:, :, 0].T
        answer = driven + d[record.seen] @ record.inputs
        remainder = (record.shown - answer) * record.weights
        # End terms: one column for each state, and a constant for each sensor for their aliasing.
        ends = np.moveaxis(through, 0, 1) * record.weights[:, :, None]
        own = np.eye(len(record.seen))[:, None, :] * record.weights[:, :, None]
        columns = np.concatenate([ends, own], axis=2).reshape(-1, n + len(record.seen))
        stacked = np.vstack([columns.real, columns.imag])
        target = np.concatenate([remainder.real.ravel(), remainder.imag.ravel()])
        size = np.linalg.norm(stacked, axis=0)
        size[(size == 0.0) | ~np.isfinite(size)] = 1.0
        base, _ = np.linalg.qr(stacked / size)
        return np.asarray(target - base @ (base.T @ target))

    def _matrices(self, z: Floats, u: Floats, p: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return A, B, C and D of the linearization, with the inputs and their derivatives as inputs."""
        equations = self._equations
        n, n_states, n_inputs = equations.n_coordinates, equations.n_states, u.size
        n_own, n_sensors = n_states - 2 * n, len(equations.sensor_names)
        flat = np.array(self._jacobians(*z, *u, 0.0, *p), dtype=np.float64)
        sizes = [n * n, n * (n_states + n_inputs), n_own * (n_states + n_inputs)]
        mass, forces, own, sensors = np.split(flat, np.cumsum(sizes))
        forces = forces.reshape(n, n_states + n_inputs)
        accelerations = np.linalg.solve(mass.reshape(n, n), forces) if n else forces
        rates = np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, n_own + n_inputs))])
        whole = np.vstack([rates, accelerations, own.reshape(n_own, n_states + n_inputs)])
        shown = sensors.reshape(n_sensors, n_states + n_inputs)
        return whole[:, :n_states], whole[:, n_states:], shown[:, :n_states], shown[:, n_states:]

    @cached_property
    def _jacobians(self) -> Any:
        equations = self._equations
        tree, structure = equations.structure.tree, equations.structure
        rows = [
            *equations.forces,
            *(tree.flattened(state.rate) for state in tree.states),
            *structure.outputs[: len(equations.sensor_names)],
        ]
        return equations.slopes(rows, [*structure.states, *equations.inputs], beside=equations.mass_entries)


def _lines(equations: RigEquations, record: Record, p: Floats, most: int) -> _Lines:
    n_samples = record.n_samples
    omega: Floats = 2.0 * np.pi * np.asarray(np.fft.rfftfreq(n_samples, record.dt)[1:], dtype=np.float64)
    hold = response_of_hold(record, omega)
    u = equations.inputs_of(record)[1]
    mean = np.zeros(u.shape[0])
    mean[0::3] = np.mean(u[0::3], axis=1)
    prescribing = equations.rig.mechanism.prescribing
    inputs = np.zeros((u.shape[0], omega.size), dtype=np.complex128)
    for i, source in enumerate(equations.rig.inputs):
        own = _spectrum(u[3 * i]) * (1.0 if source.name in prescribing else hold)
        inputs[3 * i : 3 * i + 3] = own, 1j * omega * own, -(omega**2) * own
    seen = [i for i, name in enumerate(equations.sensor_names) if name in record]
    shown = np.array([_spectrum(record[equations.sensor_names[i]]) for i in seen]).reshape(len(seen), -1)
    power = np.abs(shown) ** 2
    floor = np.median(power[:, int(0.9 * omega.size) :], axis=1, keepdims=True) + 1e-300
    usable = omega < USABLE_BAND * np.pi / record.dt
    kept = np.flatnonzero(np.any(power > SIGNIFICANT_POWER * floor, axis=0) & usable)
    kept = kept if kept.size else np.flatnonzero(usable)
    kept = kept[:: max(1, kept.size // most)]
    weights = 1.0 / np.sqrt(floor + _RELATIVE_ERROR**2 * power[:, kept])
    return _Lines(omega[kept], inputs[:, kept], shown[:, kept], weights, seen, p, mean)


def response_of_hold(record: Record, omega: Floats) -> Complexes:
    """Return the frequency response of the hold of a record's input, shape (n_lines,)."""
    phase = omega * record.dt / 2.0
    sinc = np.sin(phase) / phase
    if record.hold == "zoh":
        return np.asarray(sinc * np.exp(-1j * phase))
    return np.asarray(sinc**2 if record.hold == "foh" else np.ones_like(omega), dtype=np.complex128)


def _spectrum(signal: Floats) -> Complexes:
    return np.asarray(np.fft.rfft(signal - np.mean(signal))[1:] / signal.size)
