"""Result of a grey-box fit."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from rigsight.records.record import Floats, Record
from rigsight.simulate import Structure, Substeps


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
    digest.update(json.dumps(reported).encode())
    for name in sorted(record.signals):
        digest.update(np.ascontiguousarray(record[name]).tobytes())
    return digest.hexdigest()


def fit_key(problem: Sequence[Any], theta: Floats, settings: Sequence[Any]) -> str:
    """Return a hash of a fit: of its problem (plain data), its start and its settings.

    Start values are hashed bit by bit: a fit from a slightly different value is a different fit.
    """
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps([problem, settings]).encode())
    digest.update(theta.tobytes())
    return digest.hexdigest()
