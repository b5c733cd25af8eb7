"""A parameter at a bound is reported: the terms may make up for a value beyond it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from rigsight.discover.assembly import at_bounds
from rigsight.rigs import AXIS


def fit(d: float) -> Any:
    """What is asked of a fit."""
    return SimpleNamespace(free=("m", "d"), values={"m": 1.0, "d": d}, standard_errors={"m": 0.01, "d": 0.2})


def test_a_damping_at_zero_is_reported_and_one_within_its_error_is_not() -> None:
    (found,) = at_bounds(AXIS, fit(0.002))
    assert found.startswith("d is at its lower bound of 0 N s/m")
    assert at_bounds(AXIS, fit(0.2)) == []
