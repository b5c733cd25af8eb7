"""Data of a fit: measured samples with their weights, residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.records.record import Record
from rigsight.simulate import Structure, record_input, record_values, state_limits
from rigsight.simulate.input_hold import HeldInput

Result = TypeVar("Result")

_LEAST_RANGE = 1e-9
"""Least unit of a limited state, in units of its size: a play of zero has no range."""


@dataclass(frozen=True)
class RecordData:
    """One record as a fit sees it.

    Attributes
    ----------
    record, held
        The record, and its input between samples.
    measured
        Shape (n_samples, n_outputs), NaN where an output was not measured.
    weights
        Reciprocal noise of each output, 0 where it was not measured.
    own
        Places in the parameter vector of the constants that are the record's own, and their values.
    """

    record: Record
    held: HeldInput
    measured: NDArray[np.float64]
    weights: NDArray[np.float64]
    own: tuple[tuple[int, float], ...] = ()

    def first(self, n_samples: int) -> RecordData:
        """Return the first samples of measurement and input."""
        return replace(self, held=self.held.first(n_samples), measured=self.measured[:n_samples])

    def parameters(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return parameters, shape (n_parameters,) or (n_parameters, n_sets), with the record's own constants."""
        if not self.own:
            return p
        found = p.copy()
        for place, value in self.own:
            found[place] = value
        return found


@dataclass(frozen=True)
class FitData:
    """What is fitted to what.

    Attributes
    ----------
    structure
        Rig and effects, and behind all other states the offsets of sensors that are free.
    records
        The records.
    limited
        Which states cannot leave a range, shape (n_states,).
    unlimited_sizes
        Characteristic size of each state, shape (n_states, 1).
    accuracy
        Relative accuracy of the simulations.
    threads
        Who helps with the records.
    """

    structure: Structure
    records: tuple[RecordData, ...]
    limited: NDArray[np.bool_]
    unlimited_sizes: NDArray[np.float64]
    accuracy: float
    threads: IdleThreads = field(default_factory=IdleThreads)

    def of_each_record(self, one: Callable[[int], Result]) -> list[Result]:
        """Return what a function makes of the number of each record, in their order."""
        return self.threads.results(one, [record.record.n_samples for record in self.records])

    def state_sizes(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unit in which a fit moves each initial state, shape (n_states, n_sets).

        A state that cannot leave a range is moved in units of that range, whatever the parameters make of it: beyond an end
        nothing depends on it, and a fit that wandered there would not come back.
        """
        sizes = np.repeat(self.unlimited_sizes, p.shape[1], axis=1)
        if np.any(self.limited):
            limits = state_limits(self.structure, p)
            sizes[self.limited] = np.maximum(limits[self.limited], _LEAST_RANGE * sizes[self.limited])
        return sizes


def record_data(
    structure: Structure, record: Record, names: Sequence[str], output_noise: Mapping[str, float]
) -> RecordData:
    """Return a record as a fit sees it.

    Parameters
    ----------
    structure
        As it is simulated in the fit.
    record
        May lack outputs.
    names
        Outputs of the rig, in order.
    output_noise
        Standard deviation by which the residuals of each output are divided.
    """
    missing = np.full(record.n_samples, np.nan)
    measured = np.column_stack([record.signals.get(n, missing) for n in names])
    weights = np.array([1.0 / output_noise[n] if n in record else 0.0 for n in names])
    own = record_values(structure, {}, record)
    places = tuple((structure.names.index(name), value) for name, value in own.items())
    return RecordData(record, record_input(structure, record), measured, weights, places)


def weighted(record: RecordData, out: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return weighted residuals (n,) of the first set and its outputs minus those of each other one (n, n_sets - 1).

    Parameters
    ----------
    record
        What was measured.
    out
        Simulated outputs, shape (n_samples, n_outputs, n_sets).
    """
    used = np.flatnonzero(record.weights > 0.0)
    n_samples, _, n_sets = out.shape
    residuals = np.empty(used.size * n_samples)
    differences = np.empty((used.size * n_samples, n_sets - 1))
    for place, i in enumerate(used):
        # In place: these are the largest arrays of a fit, and every copy goes through the memory.
        rows = slice(place * n_samples, (place + 1) * n_samples)
        np.subtract(record.measured[:, i], out[:, i, 0], out=residuals[rows])
        residuals[rows] *= record.weights[i]
        np.subtract(out[:, i, :1], out[:, i, 1:], out=differences[rows])
        differences[rows] *= record.weights[i]
    return residuals, differences
