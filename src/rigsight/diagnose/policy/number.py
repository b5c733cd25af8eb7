"""One threshold or budget with its reason: each kind of number is made by a function of that name."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True)
class Stated:
    """A number of a policy as a page states it."""

    # The field and its value.
    name: str
    value: float | tuple[float, ...]
    kind: str  # the function that made it
    reason: str  # what it decides, and why it is what it is
    set_by: str  # the data that set it; empty where none did


def convention(value: Any, reason: str, set_by: str = "") -> Any:
    """Return the field of a line that somebody has to draw."""
    return _number(value, "convention", reason, set_by)


def assumption(value: Any, reason: str, set_by: str = "") -> Any:
    """Return the field of what a few rigs suggested."""
    return _number(value, "assumption", reason, set_by)


def measured(value: Any, reason: str, set_by: str) -> Any:
    """Return the field of what a study measured."""
    return _number(value, "measured", reason, set_by)


def budget(value: Any, reason: str, set_by: str = "") -> Any:
    """Return the field of how long is searched."""
    return _number(value, "budget", reason, set_by)


def _number(value: Any, kind: str, reason: str, set_by: str) -> Any:
    return field(default=value, metadata={"kind": kind, "reason": reason, "set_by": set_by})


def stated(group: Any) -> tuple[Stated, ...]:
    """Return every number of a frozen dataclass whose fields these functions made, in their order."""
    return tuple(Stated(own.name, getattr(group, own.name), **own.metadata) for own in fields(group))
