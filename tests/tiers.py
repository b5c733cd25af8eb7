"""Which parameters of a product stay in `make test`; the others are left to `make test-all`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def slow_but(*kept: object, of: Iterable[Any]) -> list[Any]:
    """Return the parameters of a test, all but those kept marked as slow; what is kept must be among them."""
    every = list(of)
    missing = [value for value in kept if value not in every]
    if missing:
        raise ValueError(f"Kept, but not among the parameters: {missing}")
    return [
        value
        if value in kept
        else pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.slow)
        for value in every
    ]
