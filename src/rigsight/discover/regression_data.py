"""Data of a discovery: a campaign, the noise of its sensors, and its records, cut into windows if the rig drifts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rigsight.campaign import Campaign
from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class RegressionData:
    """A campaign, the noise floors of its sensors, and the records that are regressed.

    Attributes
    ----------
    campaign
        The campaign.
    noise
        Noise floor of each output.
    windows
        Sections of its records to be used, for a rig that drifts; None for the whole records.
    """

    campaign: Campaign
    noise: Mapping[str, float]
    windows: tuple[Record, ...] | None = None

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
        return has_stiffness(self.campaign)

    @property
    def held(self) -> dict[str, float]:
        """Parameters held at a value: one of those that a free motion determines only up to a common factor."""
        factor = self.campaign.open_factor
        return {} if factor is None else {factor.held: factor.value}


def has_stiffness(campaign: Campaign) -> bool:
    """Return False for one motion that is given without a spring."""
    return campaign.absent_spring is None
