"""Split of the records into those that are fitted and those that select the equations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigsight.discover.regression import RegressionData
from rigsight.errors import InputError
from rigsight.records.record import Record

_LEAST_SAMPLES = 200
_HELD_BACK = 0.3


def split(data: RegressionData) -> tuple[tuple[Record, ...], tuple[Record, ...], str]:
    """Return the records to fit, those to score, and a sentence on the choice of the latter (empty for validation records)."""
    estimation = tuple(r for r in data.records if r.role == "estimation")
    validation = tuple(r for r in data.records if r.role == "validation")
    if not estimation:
        raise InputError('A discovery needs at least one record with role = "estimation".')
    for record in estimation:
        if record.n_samples < _LEAST_SAMPLES:
            raise InputError(
                f"Record '{record.name}' has {record.n_samples} samples; a discovery needs at least {_LEAST_SAMPLES} in each."
            )
    if validation:
        return estimation, validation, ""
    if len(estimation) > 1:
        names = [signal.name for signal in data.rig.inputs or data.rig.outputs]

        def strength(record: Record) -> float:
            return float(np.sqrt(sum(np.var(record[name]) for name in names if name in record)))

        middle = sorted(estimation, key=strength)[len(estimation) // 2]
        rest = tuple(record for record in estimation if record is not middle)
        return (
            rest,
            (middle,),
            f"There is no validation record; '{middle.name}' was set aside to select the terms.",
        )
    cut = int((1.0 - _HELD_BACK) * estimation[0].n_samples)
    return (
        (estimation[0].slice(0, cut),),
        (replace(estimation[0].slice(cut, None), name=f"{estimation[0].name} (end)"),),
        "There is a single record; its last part was set aside to select the terms, so no other amplitude is tested.",
    )
