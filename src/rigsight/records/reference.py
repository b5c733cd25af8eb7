"""Does a closed-loop record contain the reference of the controller, which can serve as instrument?"""

from __future__ import annotations

from collections.abc import Collection

from rigsight.records.plausibility import is_constant
from rigsight.records.record import Record

REFERENCE = "reference"
"""The signal that a record may hold beside those of its rig; a rig with a signal of this name means its own."""


def signals_beside(own: Collection[str]) -> tuple[str, ...]:
    """Return the signals that a record may contain in addition to those of its rig, whose names are given."""
    return () if REFERENCE in own else (REFERENCE,)


def instrument_of(record: Record, own: Collection[str]) -> str | None:
    """Return the name of the reference signal of a record's control loop; None if there is none, or it never changes."""
    if not signals_beside(own) or REFERENCE not in record or is_constant(record[REFERENCE]):
        return None
    return REFERENCE
