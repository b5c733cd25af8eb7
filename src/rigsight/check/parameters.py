"""Which parameters do the records determine? At the numbers before any fit, on short records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from rigsight.campaign import Campaign
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.identify.fit.windows import cut, window_length
from rigsight.identify.identifiability import Identifiability, identifiability
from rigsight.identify.information import POORLY_KNOWN, information
from rigsight.identify.linear_view import longest_free_run
from rigsight.records import Record
from rigsight.simulate import compose
from rigsight.simulate.linearization import Linearization

Status = Literal["determined", "weak", "only with others", "not determined"]
_WEAK = 0.1
"""Relative standard error from which a parameter is known badly (a convention)."""
_EVALUATIONS = 60
"""Of a rough fit: near enough for what the records determine, not for the numbers."""


@dataclass(frozen=True)
class CheckedParameter:
    """Whether the records determine a parameter."""

    name: str
    unit: str
    status: Status
    relative_error: float  # standard error over the value; infinite where nothing is known


def checked_parameters(
    campaign: Campaign,
    records: Sequence[Record],
    values: Mapping[str, float],
    noise: Mapping[str, float],
    linear: Linearization | None,
) -> tuple[tuple[CheckedParameter, ...], str]:
    """Return the parameters with the statement on those that are not determined; none where the start cannot be simulated."""
    rig, structure = campaign.rig, compose(campaign.rig, campaign.modelled)
    limit = None if linear is None else longest_free_run(linear.poles, records)
    if limit is not None or campaign.drifts:
        limit = min(window_length(rig, records), limit or np.inf)
    windows = cut(records, limit)
    scales = characteristic_scales(rig, windows, values)
    held = {campaign.absent_spring} if campaign.absent_spring else set()
    free = [p.name for p in structure.parameters if p.name not in {*campaign.constants, *held}]
    fit = GreyBoxFit(structure, windows, scales, noise)
    result = fit.fit({**values}, free, max_evaluations=_EVALUATIONS, tolerance=1e-3)
    if not result.residuals:
        return (
            (),
            "The equations cannot be simulated at these numbers, so what the records determine is not known.",
        )
    found = identifiability(information(fit, result))
    units = {p.name: p.unit for p in structure.parameters}
    return tuple(
        CheckedParameter(name, units[name], _status(name, found), error)
        for name, error in found.relative_errors.items()
    ), found.sentence


def _status(name: str, found: Identifiability) -> Status:
    error = found.relative_errors[name]
    if error < POORLY_KNOWN:
        return "determined" if error < _WEAK else "weak"
    together = {member for combination in found.combinations for member in combination.members}
    return "only with others" if name in together else "not determined"
