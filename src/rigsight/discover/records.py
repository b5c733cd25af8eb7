"""Which records a discovery fits, and which it is judged by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rigsight.campaign import Campaign
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.records.signals import same_signal
from rigsight.rigs import Rig

_LEAST_SAMPLES = 200
_HELD_BACK = 0.3
_MOST_NAMED = 3
_SAME_RATE = 1e-6
"""Relative difference up to which sample times, computed from time columns, count as equal."""


@dataclass(frozen=True)
class DiscoveryData:
    """A campaign, the noise floors of its sensors, and the records that are used."""

    campaign: Campaign
    noise: Mapping[str, float]  # floor of each output
    windows: tuple[Record, ...] | None = None  # sections of the records to be used, for a rig that drifts

    @property
    def rig(self) -> Rig:
        """The rig of the campaign."""
        return self.campaign.rig

    @property
    def records(self) -> tuple[Record, ...]:
        """Estimation and validation records, cut into windows if the rig drifts."""
        return self.campaign.records if self.windows is None else self.windows

    @property
    def has_stiffness(self) -> bool:
        """False for an axis that is given without a spring."""
        return self.campaign.absent_spring is None

    @property
    def held(self) -> dict[str, float]:
        """Parameters held at a value: one of those that a free motion determines only up to a common factor."""
        factor = self.campaign.open_factor
        return {} if factor is None else {factor.held: factor.value}


def split(data: DiscoveryData) -> tuple[tuple[Record, ...], tuple[Record, ...], str]:
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
        middle = sorted(estimation, key=partial(strength, data.rig))[len(estimation) // 2]
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


def strength(rig: Rig, record: Record) -> float:
    """Return the size of the inputs of a record, or of the outputs of a rig without inputs."""
    names = [signal.name for signal in rig.inputs or rig.outputs]
    return float(np.sqrt(sum(np.var(record[name]) for name in names if name in record)))


def same_input(sources: Sequence[str], estimation: Sequence[Record], held_out: Sequence[Record]) -> list[str]:
    """Return a warning about held-out records that have the same input as a fitted one."""
    twins = {
        record.name: fitted.name
        for record in held_out
        for fitted in estimation
        if math.isclose(record.dt, fitted.dt, rel_tol=_SAME_RATE)
        and all(same_signal(record[source], fitted[source]) for source in sources)
    }
    if not twins:
        return []
    listed = "; ".join(f"'{name}' as '{fitted}'" for name, fitted in list(twins.items())[:_MOST_NAMED])
    return [
        f"Held-out records have the input of fitted ones: {listed}. With the same input even wrong terms may fit, so the error "
        f"says little about other motion. Add a validation record with another waveform or amplitude."
    ]
