"""Checks of the signals of a file: missing, constant or clipped ones, and similar names, are reported."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from rigsight.errors import InputError, nearest
from rigsight.records.channel_names import closeness
from rigsight.records.column_mapping import Columns
from rigsight.records.conditioning import LARGEST_NUMBER
from rigsight.records.record import Floats
from rigsight.records.signals import clipping, is_constant

_LISTED = 30
"""Columns that a message lists."""


class NamedSignal(Protocol):
    """A signal that can be read: what a rig declares, seen from below."""

    @property
    def name(self) -> str:
        """Name in equations and files."""

    @property
    def unit(self) -> str:
        """SI unit."""


def check_absent(path: Path, absent: Sequence[str], table: Columns, *, is_free: bool) -> None:
    """Reject missing inputs if the rig was driven, or if a column may be one of them."""
    names = [name for name in table.names if name not in table.labels.values()]
    is_free = is_free and not all(name.isdecimal() for name in (*names, *table.labels.values()))
    for signal in absent:
        close = [name for name in names if closeness(name, signal) > 0.0]
        hint = f" Is it '{close[0]}'?" if close else nearest(signal, names)
        if not hint and is_free:
            continue
        raise InputError(
            f"{path.name} has no column '{signal}' for signal '{signal}'.{hint} Its columns: {listed_columns(table)}. "
            "Map it under columns; if it was constant and not recorded, give its value with the record: "
            f"inputs = {{ {signal} = 0.0 }}."
        )


def alike_notes(path: Path, missing: Sequence[str], table: Columns) -> list[str]:
    """Report an unread column whose name is similar to that of a missing output: possibly a typing error."""
    unread = [name for name in table.names if name not in table.labels.values()] if missing else []
    return [
        f"{path.name}: has no column '{signal}', so {signal} counts as not recorded in this file.{hint} Map it under columns if "
        f"it is."
        for signal in missing
        if (hint := nearest(signal, unread))
    ]


def listed_columns(table: Columns) -> str:
    """Return the names of the columns of a file for a message."""
    return ", ".join(f"'{name}'" for name in table.names[:_LISTED]) or "none"


def refuse_implausible(path: Path, raw: Mapping[str, Floats], table: Columns) -> None:
    """Reject implausibly large numbers, from a wrong data type or a lost decimal point."""
    for signal, samples in raw.items():
        largest = float(np.max(np.abs(samples)))
        if largest > LARGEST_NUMBER:
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': {signal} reaches {largest:.3g}; readings above "
                f"{LARGEST_NUMBER:g} are implausible. Check the column and its type."
            )


def moving(
    path: Path,
    raw: dict[str, Floats],
    table: Columns,
    needed: Collection[str],
    outputs: Sequence[NamedSignal],
) -> tuple[dict[str, Floats], list[str]]:
    """Return the signals that can be used, with notes on those that cannot."""
    constant = {signal for signal, samples in raw.items() if is_constant(samples)}
    measured = [output.name for output in outputs if output.name in raw]
    for signal in measured:
        if signal in constant and (signal in needed or constant.issuperset(measured)):
            raise InputError(
                f"{path.name}, column '{table.labels[signal]}': the output {signal} never changes ({raw[signal][0]:g}). "
                "Check sensor and column, or leave the record out."
            )
    still = sorted(constant.intersection(measured))
    notes = [f"{path.name}: {signal} never changes and counts as not measured." for signal in still]
    return {signal: samples for signal, samples in raw.items() if signal not in still}, notes


def rest_notes(
    path: Path,
    raw: Mapping[str, Floats],
    table: Columns,
    recorded: Sequence[NamedSignal],
    must_move: Collection[str],
    is_step: bool,
) -> list[str]:
    """Tell that no recorded input changes: the record begins with a step, the rig moves freely, or a column is wrong."""
    held = [signal.name for signal in recorded if signal.name in raw]
    if not held or not all(is_constant(raw[signal]) for signal in held):
        return []
    values = ", ".join(f"{signal} = {raw[signal][0]:g}" for signal in held)
    listed = ", ".join(f"'{table.labels[signal]}'" for signal in held)
    where = f"{path.name}, column{'s' if len(held) > 1 else ''} {listed}"
    if is_step and any(raw[signal][0] != 0.0 for signal in held):
        return [
            f"{where}: no input changes ({values}); taken as a step from 0 with which the record begins. Record some time at "
            "rest before the step: it shows the offset, and that the rig was at rest."
        ]
    if set(held) & set(must_move):
        raise InputError(
            f"{where}: no input changes ({values}), so nothing is excited and nothing can be identified. Check the column. "
            'For free motion write kind = "operation" without an amplitude; for a record that is only scored, '
            'role = "validation".'
        )
    return [
        f"{where}: no input changes ({values}); taken as a free motion. Check the column if the rig was driven."
    ]


def clipping_notes(path: Path, raw: Mapping[str, Floats], table: Columns) -> list[str]:
    """Report clipped signals."""
    return [
        f"Warning: {path.name}, column '{table.labels[signal]}': {signal} looks clipped, {count} samples are exactly at its "
        f"extreme {level:g}. Check range and saturation of sensor, amplifier or drive."
        for signal, samples in raw.items()
        for level, count in clipping(samples)
    ]
