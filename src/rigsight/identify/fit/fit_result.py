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
    """Result of an output-error fit.

    Attributes
    ----------
    structure
        Rig and effects that were fitted.
    success, message
        Whether the optimizer converged, and its message.
    values
        Every parameter of the structure by name, fitted or not.
    standard_errors
        Of the fitted parameters by name, allowing for colored residuals; infinite if the records do not determine the parameter.
    initial_states
        Per record, shape (n_states + n_offsets,): the states of the structure, followed by the free offsets.
    offset_names
        Sensors whose offsets were free in each record, in that order.
    cost
        Sum of squared weighted residuals.
    n_samples
        Number of residuals in that sum.
    n_evaluations
        Number of evaluations of residuals and derivatives.
    free
        Names of the fitted parameters, in the order of `covariance`.
    covariance
        Shape (n_free, n_free), in units of the parameters.
    substeps
        Integration steps per piece of the input that were used for each record.
    """

    structure: Structure
    success: bool
    message: str
    values: dict[str, float]
    standard_errors: dict[str, float]
    initial_states: tuple[Floats, ...]
    cost: float
    n_samples: int
    n_evaluations: int
    free: tuple[str, ...]
    covariance: Floats
    residuals: tuple[Floats, ...]
    """Measured minus simulated per record, shape (n_samples, n_outputs), NaN for an output that was not measured."""
    substeps: tuple[Substeps, ...] = ()
    offset_names: tuple[str, ...] = ()

    @property
    def rig_states(self) -> tuple[Floats, ...]:
        """Initial states of the structure per record, shape (n_states,), without offsets of sensors."""
        count = len(self.offset_names)
        return tuple(state[: state.size - count] for state in self.initial_states)

    def offsets(self, index: int) -> dict[str, float]:
        """Return the offset of each sensor in a record, by name; empty if none was free.

        Parameters
        ----------
        index
            Index of the record in the fit.
        """
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
