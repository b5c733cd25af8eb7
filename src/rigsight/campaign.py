"""What is a campaign: one rig, its known numbers, the given simulation, and the records about it?"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from rigsight.effects import Effect
from rigsight.identify import OpenFactor, open_factor
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate.drift import can_drift


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign, read or made of records, and checked.

    Attributes
    ----------
    title
        What a report calls it.
    rig
        The declared rig.
    constants
        All constants of the rig, defaults filled in [SI].
    parameters
        The parameters that were given, as they were given [SI]; what is missing of the rig's is to be identified.
    records
        In the order of the file, with distinct names.
    modelled
        Effects that the given simulation has already; `parameters` holds all their values.
    path
        The toml file; None for a campaign that was made of records in memory.
    notes
        What was noticed about the campaign as a whole.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    parameters: Mapping[str, float]
    records: tuple[Record, ...]
    modelled: tuple[Effect, ...] = ()
    path: Path | None = None
    notes: tuple[str, ...] = ()

    # That of the dataclass would hold every sample.
    def __repr__(self) -> str:
        names = [record.name for record in self.records]
        return f"Campaign({self.title!r}, rig={self.rig.name!r}, records={names!r})"

    @property
    def called(self) -> str:
        """How messages call it: by its file, or by its title."""
        return self.title if self.path is None else self.path.name

    @property
    def folder(self) -> Path | None:
        """The folder that holds its file."""
        return None if self.path is None else self.path.parent

    @property
    def estimation(self) -> tuple[Record, ...]:
        """Records that may be fitted."""
        return tuple(record for record in self.records if record.role == "estimation")

    @property
    def validation(self) -> tuple[Record, ...]:
        """Records that are only ever scored."""
        return tuple(record for record in self.records if record.role == "validation")

    @cached_property
    def given(self) -> dict[str, float]:
        """The parameters that were given, alternatives turned into the rig's own [SI]."""
        return self.rig.in_own_parameters(self.parameters, self.constants)

    @cached_property
    def open_factor(self) -> OpenFactor | None:
        """What the records that may be fitted tell up to a common factor only: those of a free motion."""
        return open_factor(self.rig, self.estimation, self.constants, self.given)

    @property
    def absent_spring(self) -> str | None:
        """Name of the stiffness of one driven mass that is given without a spring."""
        if not (self.rig.has_one_motion and self.rig.is_driven):
            return None
        stiffness = self.rig.motion.stiffness
        name = str(getattr(stiffness, "name", ""))
        return name if self.given.get(name) == 0.0 else None

    @cached_property
    def drifts(self) -> bool:
        """True where nothing brings the rig back, so that in free run each error of a force is integrated twice."""
        if self.rig.has_one_motion:
            return self.absent_spring is not None
        return can_drift(self.rig, {**self.constants, **self.given})
