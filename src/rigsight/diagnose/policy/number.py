"""One threshold or budget with its reason."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal, get_args

from rigsight.errors import check_option

Kind = Literal["convention", "assumption", "measured", "budget"]
"""A line that somebody has to draw; what a few rigs suggested; what a study measured; how long is searched."""


@dataclass(frozen=True)
class Stated:
    """A number of a policy as a page states it."""

    # The field and its value.
    name: str
    value: float | tuple[float, ...]
    kind: Kind  # see `Kind`
    reason: str  # what it decides, and why it is what it is
    set_by: str  # the data that set it; empty where none did


def number(value: Any, kind: Kind, reason: str, set_by: str = "") -> Any:
    """Return a dataclass field that carries why its value is what it is."""
    check_option("The kind of a number", kind, get_args(Kind))
    return field(default=value, metadata={"kind": kind, "reason": reason, "set_by": set_by})


def stated(group: Any) -> tuple[Stated, ...]:
    """Return every number of a frozen dataclass whose fields `number` made, in their order."""
    return tuple(Stated(own.name, getattr(group, own.name), **own.metadata) for own in fields(group))
