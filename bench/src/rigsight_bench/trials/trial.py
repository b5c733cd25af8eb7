"""What is a drawn trial? Its records, the given simulation, and the truth about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rigsight.records import Record
from rigsight.rigs import Rig

_DIGITS = 5
"""Digits of the given simulation's parameters."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One drawn trial.

    Attributes
    ----------
    rig
        The rig that the campaign names.
    values
        Its true constants and parameters.
    given
        Parameters of the given simulation.
    records
        What the diagnosis sees.
    withheld
        What it never sees.
    key
        The truth, ready for JSON.
    modelled
        Names of the effects that the given simulation has.
    rig_file
        Text of the rig's file; None for a built-in rig.
    offsets_by_record
        Whether each sensor has its own offset in each record.
    """

    rig: Rig
    values: Mapping[str, float]
    given: dict[str, float]
    records: tuple[Record, ...]
    withheld: tuple[Record, ...]
    key: dict[str, Any]
    modelled: tuple[str, ...] = ()
    rig_file: str | None = None
    offsets_by_record: bool = False


def off_by(rig: Rig, ends: tuple[float, float], rng: np.random.Generator) -> dict[str, float]:
    """Draw a factor for each parameter of a rig that makes it wrong, upwards or downwards.

    Parameters
    ----------
    rig
        The rig.
    ends
        Least and largest relative error.
    rng
        Source of randomness.
    """
    return {p.name: 1.0 + rng.uniform(*ends) * rng.choice([-1.0, 1.0]) for p in rig.parameters}


def as_given(values: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with as many digits as a campaign gives."""
    return {name: float(f"{value:.{_DIGITS}g}") for name, value in values.items()}
