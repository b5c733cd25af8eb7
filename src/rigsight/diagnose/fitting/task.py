"""What is to be diagnosed: records of a rig, and the simulation whose gap is in question."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from rigsight.diagnose.fitting.drift import can_drift
from rigsight.effects import Effect
from rigsight.identify import OpenFactor, open_factor
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
        Parameters of the given simulation; missing ones of the rig are identified.
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
    def absent_spring(self) -> str | None:
        """Name of the stiffness of one driven mass that is given without a spring."""
        if not (self.rig.has_one_motion and self.rig.is_driven):
            return None
        stiffness = self.rig.motion.stiffness
        name = str(getattr(stiffness, "name", ""))
        return name if self.given.get(name) == 0.0 else None

    @cached_property
    def open_factor(self) -> OpenFactor | None:
        """Parameters that the fitted records determine only up to a common factor (free motion)."""
        return open_factor(self.rig, self.estimation, self.constants, self.given)

    @cached_property
    def drifts(self) -> bool:
        """True if the rig has no restoring force, so that in free run each force error is integrated twice."""
        if self.rig.has_one_motion:
            return self.absent_spring is not None
        return can_drift(self.rig, {**self.constants, **self.given})
