"""Task of a discovery: records and a rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class Task:
    """What is to be discovered.

    Attributes
    ----------
    title
        For people.
    rig
        The rig.
    constants
        Every constant of the rig.
    records
        Estimation and validation records, cut into windows where the rig drifts.
    noise
        Noise floor of each output.
    has_stiffness
        False for an axis without a spring.
    held
        Parameters that keep a value: of those that a free motion tells up to a common factor one.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    records: tuple[Record, ...]
    noise: Mapping[str, float]
    has_stiffness: bool = True
    held: Mapping[str, float] = field(default_factory=dict)
