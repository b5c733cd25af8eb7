"""Quantities with which a parameter may change between records: amplitude, constants, order in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rigsight.diagnose.fitting.windows import leading_output
from rigsight.diagnose.policy import TRUST
from rigsight.diagnose.trust.patterns import Pattern
from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class Order:
    """A quantity by which records differ."""

    pattern: Pattern  # pattern of a parameter that changes with it
    name: str  # in words, such as ``"amplitude"`` or the name of a constant
    unit: str  # of the quantity; empty for a plain number
    levels: Mapping[str, float]  # its value by the name of the record


def orders(rig: Rig, records: Sequence[Record], constants: Mapping[str, float]) -> tuple[Order, ...]:
    """Return the quantities by which records differ; set values first, the order of the records last."""
    found = []
    units = {p.name: _told(p.unit) for p in rig.constants}
    for name in dict.fromkeys(name for record in records for name in record.constants):
        levels = {r.name: r.constants.get(name, constants.get(name, np.nan)) for r in records}
        if len(set(levels.values())) > 1 and all(map(np.isfinite, levels.values())):
            found.append(Order(Pattern.CONSTANT, name, units.get(name, ""), levels))
    amplitude = _amplitudes(rig, records)
    if len(set(amplitude.levels.values())) > 1:
        found.append(amplitude)
    if len(records) >= TRUST.fewest_in_time:
        found.append(Order(Pattern.TIME, "time", "", {r.name: float(i) for i, r in enumerate(records)}))
    return tuple(found)


def _amplitudes(rig: Rig, records: Sequence[Record]) -> Order:
    """Return the stated amplitude of each record if all have one, else the measured one, grouped in levels."""
    moving = [s for s in rig.inputs if all(s.name in r and np.ptp(r[s.name]) > 0.0 for r in records)]
    # A free motion has no amplitude but its own.
    outputs = {signal.name: signal for signal in rig.outputs}
    signal = moving[0] if moving else outputs[leading_output(rig, records)]
    stated = [record.amplitude for record in records]
    known = [amplitude for amplitude in stated if amplitude is not None]
    if moving and len(known) == len(records):
        levels = dict(zip((r.name for r in records), map(float, known), strict=True))
        return Order(Pattern.AMPLITUDE, "amplitude", _told(signal.unit), levels)
    sizes = {r.name: float(np.sqrt(2.0) * np.std(r[signal.name])) for r in records if signal.name in r}
    if len(sizes) < len(records):
        return Order(Pattern.AMPLITUDE, "amplitude", _told(signal.unit), {})
    level, measured = 0.0, {}
    for name, size in sorted(sizes.items(), key=lambda item: item[1]):
        level = level if size <= TRUST.one_level * level else size
        measured[name] = level
    return Order(Pattern.AMPLITUDE, "amplitude", _told(signal.unit), measured)


def _told(unit: str) -> str:
    """Return a unit as written behind a number; the unit of an axis' input is called "input"."""
    return "" if unit in ("input", "1") else unit
