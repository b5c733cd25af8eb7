"""What is to be diagnosed: records of a rig, and the simulation whose gap is in question."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rigsight.effects import Effect
from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class Task:
    """What is to be diagnosed.

    Attributes
    ----------
    title
        For people.
    rig
        The rig.
    constants
        Every constant of the rig.
    given
        Parameters of the simulation whose gap is in question; what is missing of the rig's is identified.
    records
        Estimation and validation records.
    modelled
        Effects that this simulation has already; `given` holds all their values.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    given: Mapping[str, float]
    records: tuple[Record, ...]
    modelled: tuple[Effect, ...] = ()

    @property
    def estimation(self) -> tuple[Record, ...]:
        """Records to fit."""
        return tuple(record for record in self.records if record.role == "estimation")

    @property
    def validation(self) -> tuple[Record, ...]:
        """Records to score."""
        return tuple(record for record in self.records if record.role == "validation")

    @property
    def has_spring(self) -> bool:
        """False for an axis that is given without one."""
        return not (self.rig.name == "axis" and self.given.get("k") == 0.0)
