"""What is regressed: a campaign, the noise of its sensors, and its records in windows where the rig drifts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rigsight.campaign import Campaign
from rigsight.records.record import Record
from rigsight.rigs import Rig


@dataclass(frozen=True)
class RegressionData:
    """What is regressed.

    Attributes
    ----------
    campaign
        The campaign.
    noise
        Noise floor of each output.
    windows
        What is regressed of its records, cut where the rig drifts; None for all of them as they are.
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
        """Estimation and validation records, cut into windows where the rig drifts."""
        return self.campaign.records if self.windows is None else self.windows

    @property
    def has_stiffness(self) -> bool:
        """False for an axis that is given without a spring."""
        return has_stiffness(self.campaign)

    @property
    def held(self) -> dict[str, float]:
        """Parameters that keep a value: of those that a free motion tells up to a common factor one."""
        factor = self.campaign.open_factor
        return {} if factor is None else {factor.held: factor.value}


def has_stiffness(campaign: Campaign) -> bool:
    """Return False for one motion that is given without a spring.

    Parameters
    ----------
    campaign
        The campaign.
    """
    return not (campaign.rig.has_one_motion and campaign.parameters.get("k") == 0.0)
