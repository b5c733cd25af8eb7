"""Data of a fit: measured samples with their weights, residuals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure, record_input, record_values, state_limits
from rigsight.simulate.input_hold import HeldInput

Result = TypeVar("Result")

_LEAST_RANGE = 1e-9
"""Smallest unit of a state with a limited range, relative to its size, because a play of zero has no range."""


@dataclass(frozen=True)
class RecordData:
    """One record in the form that a fit needs."""

    # The record, and its input between samples.
    record: Record
    held: HeldInput
    measured: Floats  # shape (n_samples, n_outputs), NaN for an output that was not measured
    weights: Floats  # reciprocal noise of each output, 0 if it was not measured
    # Indices in the parameter vector of the record's own constants, and their values.
    own: tuple[tuple[int, float], ...] = ()

    def first(self, n_samples: int) -> RecordData:
        """Return the data with only the first samples of measurement and input."""
        return replace(self, held=self.held.first(n_samples), measured=self.measured[:n_samples])

    def parameters(self, p: Floats) -> Floats:
        """Return parameters, shape (n_parameters,) or (n_parameters, n_sets), with the record's own constants."""
        if not self.own:
            return p
        found = p.copy()
        for place, value in self.own:
            found[place] = value
        return found


@dataclass(frozen=True)
class FitData:
    """Structure and records of a fit."""

    structure: Structure  # rig and effects; the free offsets of sensors come after all other states
    records: tuple[RecordData, ...]
    limited: NDArray[np.bool_]  # true for states that cannot leave a range, shape (n_states,)
    unlimited_sizes: Floats  # characteristic size of each state, shape (n_states, 1)
    accuracy: float  # relative accuracy of the simulations
    # Threads among which the records are distributed.
    threads: IdleThreads = field(default_factory=IdleThreads)

    def of_each_record(self, one: Callable[[int], Result]) -> list[Result]:
        """Return the results of a function for the index of each record, in their order."""
        return self.threads.results(one, [record.record.n_samples for record in self.records])

    def state_sizes(self, p: Floats) -> Floats:
        """Return the unit of each initial state in the fit, shape (n_states, n_sets).

        A state with a limited range is fitted in units of that range, which may depend on the parameters: beyond its ends the
        outputs do not depend on the state, and a fit that got there would not return.
        """
        sizes = np.repeat(self.unlimited_sizes, p.shape[1], axis=1)
        if np.any(self.limited):
            limits = state_limits(self.structure, p)
            sizes[self.limited] = np.maximum(limits[self.limited], _LEAST_RANGE * sizes[self.limited])
        return sizes


def record_data(
    structure: Structure, record: Record, names: Sequence[str], output_noise: Mapping[str, float]
) -> RecordData:
    """Return a record in the form that a fit needs."""
    missing = np.full(record.n_samples, np.nan)
    measured = np.column_stack([record.signals.get(n, missing) for n in names])
    weights = np.array([1.0 / output_noise[n] if n in record else 0.0 for n in names])
    own = record_values(structure, {}, record)
    places = tuple((structure.names.index(name), value) for name, value in own.items())
    return RecordData(record, record_input(structure, record), measured, weights, places)


def weighted(record: RecordData, out: Floats) -> tuple[Floats, Floats]:
    """Return weighted residuals (n,) of the first set and its outputs minus those of each other one (n, n_sets - 1)."""
    used = np.flatnonzero(record.weights > 0.0)
    n_samples, _, n_sets = out.shape
    residuals = np.empty(used.size * n_samples)
    differences = np.empty((used.size * n_samples, n_sets - 1))
    for place, i in enumerate(used):
        # In place, because these are the largest arrays of a fit and copies would be slow.
        rows = slice(place * n_samples, (place + 1) * n_samples)
        np.subtract(record.measured[:, i], out[:, i, 0], out=residuals[rows])
        residuals[rows] *= record.weights[i]
        np.subtract(out[:, i, :1], out[:, i, 1:], out=differences[rows])
        differences[rows] *= record.weights[i]
    return residuals, differences
