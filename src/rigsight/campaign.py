"""A campaign: one rig with its known constants, the given simulation, and the records."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from rigsight.effects import Effect
from rigsight.identify import OpenFactor, open_factor, weighed_spring
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.simulate.equilibrium import can_drift


@dataclass(frozen=True, eq=False)
class Campaign:
    """A campaign, read from a file or made from records, and checked.

    Attributes
    ----------
    title
        Name in reports.
    rig
        The declared rig.
    constants
        All constants of the rig, defaults filled in [SI].
    parameters
        The given parameter values [SI]; missing ones are identified from the records.
    records
        In the order of the file, with distinct names.
    modelled
        Effects that the given simulation already has; `parameters` contains all their values.
    path
        The toml file; None for a campaign that was made of records in memory.
    notes
        Notes on the campaign as a whole.
    spring_released
        True if the records show a spring that the given simulation lacks, so that fits estimate it.
    """

    title: str
    rig: Rig
    constants: Mapping[str, float]
    parameters: Mapping[str, float]
    records: tuple[Record, ...]
    modelled: tuple[Effect, ...] = ()
    path: Path | None = None
    notes: tuple[str, ...] = ()
    spring_released: bool = False

    # The repr of the dataclass would contain every sample.
    def __repr__(self) -> str:
        names = [record.name for record in self.records]
        return f"Campaign({self.title!r}, rig={self.rig.name!r}, records={names!r})"

    @property
    def called(self) -> str:
        """Its name in messages: the file or the title."""
        return self.title if self.path is None else self.path.name

    @property
    def folder(self) -> Path | None:
        """The folder of its file."""
        return None if self.path is None else self.path.parent

    @property
    def estimation(self) -> tuple[Record, ...]:
        """Records that may be fitted."""
        return tuple(record for record in self.records if record.role == "estimation")

    @property
    def validation(self) -> tuple[Record, ...]:
        """Records that are only scored."""
        return tuple(record for record in self.records if record.role == "validation")

    @cached_property
    def given(self) -> dict[str, float]:
        """The given parameter values, with alternatives converted into parameters of the rig [SI]."""
        return self.rig.in_own_parameters(self.parameters, self.constants)

    @cached_property
    def open_factor(self) -> OpenFactor | None:
        """Parameters that the estimation records determine only up to a common factor, because the motion is free."""
        return open_factor(self.rig, self.estimation, self.constants, self.given)

    @property
    def absent_spring(self) -> str | None:
        """Name of the stiffness parameter if fits hold it at zero, because one driven mass is given without a spring."""
        return None if self.spring_released else self.given_without_spring

    @property
    def given_without_spring(self) -> str | None:
        """Name of the stiffness parameter if the given simulation is one driven mass without a spring."""
        if not (self.rig.has_one_motion and self.rig.is_driven):
            return None
        stiffness = self.rig.motion.stiffness
        name = str(getattr(stiffness, "name", ""))
        return name if self.given.get(name) == 0.0 else None

    @cached_property
    def drifts(self) -> bool:
        """True if the rig has no restoring force, so that in free run force errors are integrated twice."""
        if self.rig.has_one_motion:
            return self.given_without_spring is not None
        return can_drift(self.rig, {**self.constants, **self.given})


def with_weighed_spring(campaign: Campaign) -> Campaign:
    """Return a campaign whose fits estimate an absent spring if its records show one, with a note on what was found.

    The given simulation keeps a stiffness of zero.
    """
    name, factor = campaign.absent_spring, campaign.open_factor
    if name is None:
        return campaign
    held = {} if factor is None else {factor.held: factor.value}
    weighed = weighed_spring(
        campaign.rig, campaign.estimation, campaign.constants, campaign.given, campaign.modelled, name, held
    )
    if weighed is None:
        return campaign
    found, note = weighed
    return replace(campaign, spring_released=found, notes=(*campaign.notes, note))
