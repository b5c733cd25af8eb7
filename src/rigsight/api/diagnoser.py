"""The diagnosis as an estimator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Self

from rigsight.api.diagnosis_result import DiagnosisResult
from rigsight.api.estimator import CampaignEstimator, campaign_of
from rigsight.campaign import Campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import effects_of
from rigsight.workflow.campaign.model_file import model_of
from rigsight.workflow.diagnose import diagnose_campaign
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress_display import listening


class Diagnoser(CampaignEstimator):
    """Find the effect that is missing in a simulation, where it acts, and how far it closes the gap.

    Each candidate is added to the simulation and fitted to the estimation records by output error; the ranking
    is by the validation records. The same as ``rigsight diagnose``.

    Parameters
    ----------
    effects
        Candidates, by name or as declarations of your own; None for the whole catalogue.
    seed
        Seed of the resampling behind probabilities and intervals.
    n_jobs
        Candidates fitted at the same time; None for one per processor.
    verbose
        Show progress on stderr.
    rig
        Rig of the records if `fit` gets records instead of a campaign: the name of a built-in rig, or a rig of your own.

    Attributes
    ----------
    diagnosis_
        The result: verdict, ranking, gap budget.
    model_
        The diagnosed simulation, with the effects of the verdict added.

    References
    ----------
    L. Ljung, *System Identification* (Prentice Hall 1999), chapters 7 and 9, for output error and its covariance. H. R.
    Kuensch, Ann. Statist. 17 (1989) 1217, for the block bootstrap behind the probabilities.

    Examples
    --------
    A stage with a hardening spring; its given simulation has the mass, the damper and a linear spring:

    >>> import rigsight as rs
    >>> campaign = rs.example_campaign()
    >>> diagnoser = rs.Diagnoser(effects=["cubic_stiffness"], n_jobs=1).fit(campaign)
    >>> found = diagnoser.diagnosis_
    >>> found.verdict, found.effects, found.where
    ('effect', ('cubic_stiffness',), ('dynamics',))
    >>> gap = found.gap["x"]
    >>> print(f"{gap.before:.0%} given, {gap.after:.1%} with the effect, {gap.noise_floor:.1%} noise")
    123% given, 0.4% with the effect, 0.3% noise
    """

    diagnosis_: DiagnosisResult

    def __init__(
        self,
        effects: Sequence[str | Effect] | None = None,
        seed: int = 0,
        n_jobs: int | None = None,
        verbose: bool = False,
        rig: str | Rig | None = None,
    ) -> None:
        self.effects = effects
        self.seed = seed
        self.n_jobs = n_jobs
        self.verbose = verbose
        self.rig = rig

    def fit(self, campaign: Campaign | Sequence[Record] | str | Path) -> Self:
        """Diagnose the gap between the simulation that a campaign gives and its records.

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
            If the campaign cannot be used or a candidate is unknown.
        SimulationError
            If the given simulation cannot be run.
        """
        effects = CATALOGUE if self.effects is None else effects_of(self.effects)
        own = [effect for effect in effects if effect not in CATALOGUE]
        jobs = checked_jobs(self.n_jobs)
        read = campaign_of(campaign, own, rig=self.rig)
        known = (*own, *read.modelled)
        with listening(quiet=not self.verbose) as listener:
            found = diagnose_campaign(read, effects, self.seed, jobs, listener)
        tried = None if self.effects is None else [effect.name for effect in effects]
        made_by = f"rigsight.Diagnoser(effects={tried}, seed={self.seed}).fit(...)"
        self.diagnosis_ = DiagnosisResult.of(found, made_by, self.seed, known)
        self.model_ = model_of(found.model, known)
        return self
