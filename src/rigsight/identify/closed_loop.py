"""Notes on records that contain the reference of a closed loop."""

from __future__ import annotations

from collections.abc import Sequence

from rigsight.records.record import Record
from rigsight.records.signals import REFERENCE, instrument_of, signals_beside
from rigsight.rigs import Rig

_LISTED = 5


def closed_loop_notes(records: Sequence[Record], rig: Rig, used: str) -> list[str]:
    """Return notes on the records that are treated as closed-loop records; empty if none contains a reference."""
    own = [signal.name for signal in (*rig.inputs, *rig.outputs)]
    if not signals_beside(own):
        return []
    holding = [record for record in records if REFERENCE in record]
    moving = [record.name for record in holding if instrument_of(record, own)]
    still = [record.name for record in holding if record.name not in moving]
    notes = []
    if moving:
        inputs = " and ".join(signal.name for signal in rig.inputs)
        notes.append(
            f"A {REFERENCE} is recorded in {_listed(moving)}: the records are treated as closed-loop records. {used} Time-domain "
            f"fits and simulations use {inputs} as measured, including its noise."
        )
    if still:
        notes.append(f"The {REFERENCE} never changes in {_listed(still)}, so it was not used there.")
    return notes


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(f"'{name}'" for name in names[:_LISTED]) + more
