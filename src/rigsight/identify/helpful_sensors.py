"""Unrecorded sensors of the rig that would make more parameters identifiable, computed with the fitted model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rigsight.errors import SimulationError
from rigsight.identify.fit.fit_result import FitResult
from rigsight.identify.fit.grey_box import GreyBoxFit
from rigsight.identify.identifiability import free_directions
from rigsight.identify.information import information
from rigsight.records.record import Record
from rigsight.simulate import Structure, record_values, simulate

_NOISE = 0.01
"""Assumed noise of an unrecorded sensor, relative to the RMS of its reading: that of a mediocre sensor."""


def helpful_sensors(
    structure: Structure,
    records: Sequence[Record],
    scales: Mapping[str, float],
    noise: Mapping[str, float],
    result: FitResult,
) -> tuple[str, ...]:
    """Return a sentence for each unrecorded sensor with which fewer directions of the parameters would be undetermined."""
    lacking = [s.name for s in structure.rig.outputs if not any(s.name in record for record in records)]
    before = free_directions(information(GreyBoxFit(structure, records, scales, noise), result))
    if not lacking or not before:
        return ()
    try:
        shown = [
            simulate(structure, record_values(structure, result.values, record), record, state)
            for record, state in zip(records, result.rig_states, strict=True)
        ]
    except SimulationError:
        return ()
    told = []
    for name in lacking:
        with_it = [record.with_signals(**{name: s[name]}) for record, s in zip(records, shown, strict=True)]
        size = float(np.std(np.concatenate([s[name] for s in shown])))
        if size == 0.0:
            continue
        fit = GreyBoxFit(structure, with_it, scales, {**noise, name: _NOISE * size})
        left = free_directions(information(fit, result))
        if left < before:
            much = "all parameters" if left == 0 else "more of them"
            told.append(f"If '{name}' were also recorded, these inputs would determine {much}.")
    return tuple(told)
