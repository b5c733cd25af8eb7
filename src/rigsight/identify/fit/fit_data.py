"""What goes into a fit, what comes out of it, and how outcomes are recalled."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigsight.identify.fit.coordinates import Coordinates
from rigsight.identify.fit.idle_threads import IdleThreads
from rigsight.records.record import Floats, Record
from rigsight.simulate import (
    Structure,
    Substeps,
    record_input,
    record_values,
    simulate_outputs,
    simulate_sets,
    state_limits,
)
from rigsight.simulate.input_hold import HeldInput

Result = TypeVar("Result")
_LEAST_RANGE = 1e-9
"""Smallest unit of a state with a limited range, relative to its size, because a play of zero has no range."""


@dataclass(frozen=True)
class FitResult:
    """Result of an output-error fit."""

    structure: Structure  # rig and effects that were fitted
    success: bool  # whether the optimizer converged
    message: str  # that of the optimizer
    values: dict[str, float]  # every parameter of the structure by name, fitted or not
    standard_errors: dict[str, float]  # of the fitted ones, for colored residuals; infinite if undetermined
    initial_states: tuple[Floats, ...]  # per record: states of the structure, then free offsets
    cost: float  # sum of squared weighted residuals
    n_samples: int  # number of residuals in that sum
    n_evaluations: int  # of residuals and derivatives
    free: tuple[str, ...]  # names of the fitted parameters, in the order of `covariance`
    covariance: Floats  # shape (n_free, n_free), in units of the parameters
    # Measured minus simulated per record, shape (n_samples, n_outputs), NaN for an output that was not measured.
    residuals: tuple[Floats, ...]
    substeps: tuple[Substeps, ...] = ()  # integration steps per piece of the input of each record
    offset_names: tuple[str, ...] = ()  # sensors whose offsets were free in each record, in that order

    @property
    def all_values(self) -> dict[str, float]:
        """Values of all parameters by name, with those that are written into the equations of the structure."""
        return {**self.values, **dict(self.structure.fixed)}

    @property
    def rig_states(self) -> tuple[Floats, ...]:
        """Initial states of the structure per record, shape (n_states,), without offsets of sensors."""
        count = len(self.offset_names)
        return tuple(state[: state.size - count] for state in self.initial_states)

    def offsets(self, index: int) -> dict[str, float]:
        """Return the offset of each sensor in the record with an index in the fit, by name; empty if none was free."""
        if not self.offset_names:
            return {}
        own = self.initial_states[index][-len(self.offset_names) :]
        return dict(zip(self.offset_names, map(float, own), strict=True))

    @property
    def weighted_rms(self) -> float:
        """RMS of the weighted residuals."""
        return float(np.sqrt(self.cost / self.n_samples))


class FitMemory(Protocol):
    """Storage of the outcomes of fits, so that interrupted work can be continued."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the outcome that was stored under a key, None if there is none."""

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        """Store an outcome, which consists of numbers and text, under a key."""


def record_digest(record: Record) -> str:
    """Return a hash of everything that a fit uses of a record."""
    digest = hashlib.blake2b(digest_size=16)
    reported: list[Any] = [record.n_samples, record.dt, record.hold, sorted(record.signals)]
    # Added only if present, so that outcomes stored before such constants existed remain valid.
    reported += [sorted(record.constants.items())] if record.constants else []
    reported += [sorted(record.observed.items())] if record.observed else []
    reported += [record.starting_samples] if record.starting_samples else []
    digest.update(json.dumps(reported).encode())
    for name in sorted(record.signals):
        digest.update(np.ascontiguousarray(record[name]).tobytes())
    return digest.hexdigest()


def fit_key(problem: Sequence[Any], theta: Floats, settings: Sequence[Any]) -> str:
    """Return a hash of a fit: of its problem (plain data), its start and its settings."""
    # Start values are hashed bit by bit: a fit from a slightly different value is a different fit.
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps([problem, settings]).encode())
    digest.update(theta.tobytes())
    return digest.hexdigest()


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

    @cached_property
    def spreads(self) -> Floats:
        """Standard deviation of each output as measured, shape (n_outputs,), 0 where it was not."""
        return np.where(self.weights > 0.0, np.std(self.measured, axis=0), 0.0)

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
    prior: Prior | None = None  # what is known of the parameters beside the records

    @cached_property
    def n_readings(self) -> int:
        """Number of measured samples of all outputs."""
        return int(sum(np.count_nonzero(np.isfinite(record.measured)) for record in self.records))

    def of_each_record(self, one: Callable[[int], Result]) -> list[Result]:
        """Return the results of a function for the index of each record, in their order."""
        return self.threads.results(one, [record.record.n_samples for record in self.records])

    def simulated(self, record: RecordData, p: Floats, states: Floats, substeps: int | Substeps) -> Floats:
        """Return the outputs of parameter sets on a record, see `simulate_sets`."""
        n_samples = record.record.n_samples
        return simulate_sets(self.structure, record.held, record.parameters(p), states, n_samples, substeps)

    def accurate(self, record: RecordData, p: Floats, state: Floats, accuracy: float) -> Floats:
        """Return the accurately simulated outputs of one parameter set on a record, shape (n_samples, n_outputs)."""
        n_samples = record.record.n_samples
        return simulate_outputs(self.structure, record.held, record.parameters(p), state, n_samples, accuracy)

    def state_sizes(self, p: Floats) -> Floats:
        """Return the unit of each initial state in the fit, shape (n_states, n_sets)."""
        # A state with a limited range is fitted in units of that range, which may depend on the parameters: beyond its ends the
        # outputs do not depend on the state, and a fit that got there would not return.
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


def free_names(structure: Structure, of_rig: Iterable[str]) -> list[str]:
    """Return these parameters of the rig and all of the effects that a fit may move, in the order of the structure."""
    names, fixed = set(of_rig), dict(structure.fixed)
    for effect in structure.effects:
        own = (structure.parameter_name(effect, p.name) for p in effect.parameters if p.fitted)
        names.update(name for name in own if name not in fixed)
    return [name for name in structure.names if name in names]


@dataclass(frozen=True)
class Prior:
    """Costs d^T C d more per reading, in its squared noise, where the parameters differ by d from known values."""

    names: tuple[str, ...]
    values: Floats  # shape (n,), in units of the parameters
    curvature: Floats  # C, shape (n, n), symmetric, in reciprocal units of two parameters

    def add(
        self, coordinates: Coordinates, theta: Floats, n_readings: int, normal: Floats, gradient: Floats
    ) -> float:
        """Add the normal equations of this cost in place to those of the first coordinates, and return the cost."""
        at = [coordinates.structure.names.index(name) for name in self.names]
        away = coordinates.to_parameters(theta)[at] - self.values
        slopes, curvature = coordinates.derivatives(theta)[at], n_readings * self.curvature
        normal[: theta.size, : theta.size] += slopes.T @ curvature @ slopes
        gradient[: theta.size] += slopes.T @ curvature @ away
        return float(away @ curvature @ away)
