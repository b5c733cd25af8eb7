"""The identification of the linear rig as an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rigsight.api.estimator import CampaignEstimator, campaign_of
from rigsight.api.identification_result import IdentificationResult
from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import effects_of
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.identify import checked_options, identify_campaign
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress_display import listening


class LinearIdentifier(CampaignEstimator):
    """Identify the parameters of the linear rig, from each record alone and from all of them together.

    Frequency responses of sweeps and multisines are estimated and fitted, steps are fitted in the time domain, and one parameter
    set is fitted to all estimation records by output error. The same as ``rigsight identify``.

    Parameters
    ----------
    method
        Estimator of the frequency responses: ``"local_rational"``, ``"local_polynomial"``, ``"h1"`` or ``"thesis"``.
    resolution
        Requested frequency resolution [rad/s]; None uses that of each record.
    n_jobs
        Records identified at the same time; None for one per processor.
    verbose
        Show progress on stderr.
    rig
        Rig of the records if `fit` gets records instead of a campaign: the name of a built-in rig, or a rig of your own.
    effects
        Effects with which the rig is calibrated as well, by name or as declarations; at least one of them with memory.
    seed
        Seed of this calibration.

    Attributes
    ----------
    identification_
        The result: parameters of each record and of all together, with standard errors.
    model_
        The linear simulation with the parameters of all records together; with `effects`, the simulation with them.

    References
    ----------
    R. Pintelon and J. Schoukens, *System Identification: A Frequency Domain Approach* (Wiley 2012), chapters 7 and 9. T.
    McKelvey and G. Guerin, 16th IFAC Symposium on System Identification (2012), for the local rational method.

    Examples
    --------
    >>> import rigsight as rs
    >>> identifier = rs.LinearIdentifier(n_jobs=1).fit(rs.example_campaign())
    >>> [record.record.name for record in identifier.identification_.records]
    ['fit']
    """

    identification_: IdentificationResult

    def __init__(
        self,
        method: str = "local_rational",
        resolution: float | None = None,
        n_jobs: int | None = None,
        verbose: bool = False,
        rig: str | Rig | None = None,
        effects: Sequence[str | Effect] = (),
        seed: int = 0,
    ) -> None:
        self.method = method
        self.resolution = resolution
        self.n_jobs = n_jobs
        self.verbose = verbose
        self.rig = rig
        self.effects = effects
        self.seed = seed

    def fit(self, campaign: Campaign | Sequence[Record] | str | Path) -> Self:
        """Identify the estimation records of a campaign; its validation records are only scored.

        Parameters
        ----------
        campaign
            A campaign, the toml file or the folder that contains one, or records of `rig`.

        Returns
        -------
        The estimator itself.

        Raises
        ------
        InputError
            If the campaign cannot be used, the method is unknown, a record is too short for the requested resolution, no record
            shows the motion, or an effect is unknown or cannot be calibrated on the rig.
        """
        options = checked_options(self.method, self.resolution)
        jobs = checked_jobs(self.n_jobs)
        effects = effects_of(self.effects)
        own = [effect for effect in effects if effect not in CATALOGUE]
        read = campaign_of(campaign, own, rig=self.rig)
        with listening(quiet=not self.verbose) as listener:
            found = identify_campaign(read, options, jobs, listener, effects=effects, seed=self.seed)
        self.identification_ = IdentificationResult.of(found)
        self.model_ = model_of(found.model, (*own, *read.modelled))
        return self
