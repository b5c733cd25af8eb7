"""Cache of fits: the key of a fit and its stored result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rigsight.records.record import Record


class FitMemory(Protocol):
    """Storage of the outcomes of fits, so that interrupted work can be continued."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the outcome that was stored under a key, None if there is none."""

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        """Store an outcome, which consists of numbers and text, under a key."""


def record_digest(record: Record) -> str:
    """Return a hash of everything that a fit uses of a record."""
    digest = hashlib.blake2b(digest_size=16)
    told: list[Any] = [record.n_samples, record.dt, record.hold, sorted(record.signals)]
    # Added only if present, so that outcomes stored before such constants existed remain valid.
    told += [sorted(record.constants.items())] if record.constants else []
    told += [sorted(record.observed.items())] if record.observed else []
    digest.update(json.dumps(told).encode())
    for name in sorted(record.signals):
        digest.update(np.ascontiguousarray(record[name]).tobytes())
    return digest.hexdigest()


def fit_key(problem: Sequence[Any], theta: NDArray[np.float64], settings: Sequence[Any]) -> str:
    """Return a hash of a fit: of its problem (plain data), its start and its settings.

    Start values are hashed bit by bit: a fit from a slightly different value is a different fit.
    """
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps([problem, settings]).encode())
    digest.update(theta.tobytes())
    return digest.hexdigest()
