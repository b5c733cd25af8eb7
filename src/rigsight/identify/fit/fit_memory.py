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
    """Where the outcomes of fits are kept, so that work that was interrupted goes on where it stopped."""

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the outcome that was remembered under a key, None if there is none."""

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        """Keep an outcome, numbers and text only, under a key."""


def record_digest(record: Record) -> str:
    """Return a hash of all that a fit takes from a record."""
    digest = hashlib.blake2b(digest_size=16)
    told: list[Any] = [record.n_samples, record.dt, record.hold, sorted(record.signals)]
    # Without any of its own, what was remembered before there were such constants stays known.
    told += [sorted(record.constants.items())] if record.constants else []
    told += [sorted(record.observed.items())] if record.observed else []
    digest.update(json.dumps(told).encode())
    for name in sorted(record.signals):
        digest.update(np.ascontiguousarray(record[name]).tobytes())
    return digest.hexdigest()


def fit_key(problem: Sequence[Any], theta: NDArray[np.float64], settings: Sequence[Any]) -> str:
    """Return a hash of a fit: of its problem (plain data), of its start and of its settings.

    The number of a start is hashed bit by bit: a fit from a neighboring value is another fit.
    """
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps([problem, settings]).encode())
    digest.update(theta.tobytes())
    return digest.hexdigest()
