"""The diagnosis as an estimator."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self, get_args

from rigsight.api.base import CampaignEstimator, Result
from rigsight.campaign import Campaign
from rigsight.diagnose import Diagnosis
from rigsight.diagnose.location.trace import STAGES
from rigsight.effects import CATALOGUE, Effect
from rigsight.errors import check_option
from rigsight.report.record_views import record_drawing
from rigsight.report.sections import TRUST_COLUMNS, budget_drawing, ranking_drawing, trust_drawing, trust_rows
from rigsight.report.terminal import diagnosis_html
from rigsight.report.wording import named_candidate
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import effects_of
from rigsight.workflow.diagnose import diagnose_campaign, result_files
from rigsight.workflow.run.progress import Listener
from rigsight.workflow.run.results import write_together

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure


Picture = Literal["gap", "candidates", "record", "trust"]
Table = Literal["candidates", "gap", "parameters", "trust"]


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

    def _effects(self) -> Sequence[Effect]:
        return CATALOGUE if self.effects is None else effects_of(self.effects)

    def _fit(self, campaign: Campaign, n_jobs: int, listener: Listener) -> DiagnosisResult:
        effects = self._effects()
        found = diagnose_campaign(campaign, effects, self.seed, n_jobs, listener)
        tried = None if self.effects is None else [effect.name for effect in effects]
        made_by = f"rigsight.Diagnoser(effects={tried}, seed={self.seed}).fit(...)"
        self.diagnosis_ = DiagnosisResult.of(
            found, made_by, self.seed, (*self._own_effects(), *campaign.modelled)
        )
        return self.diagnosis_


@dataclass(frozen=True)
class DiagnosisResult(Result, Diagnosis):
    """The result of a diagnosis, as it is in ``diagnosis.json``; saved with ``model.json`` and ``report.html``.

    Attributes
    ----------
    made_by
        The command or call that made it; quoted in the report.
    seed
        Seed of the diagnosis, None where it is not known.
    own_effects
        Effects beside those of the catalogue that it may name; the report shows their equations.
    """

    made_by: str = "rigsight"
    seed: int | None = None
    own_effects: tuple[Effect, ...] = ()

    @classmethod
    def of(
        cls,
        found: Diagnosis,
        made_by: str = "rigsight",
        seed: int | None = None,
        own_effects: Iterable[Effect] = (),
    ) -> Self:
        """Return a diagnosis of any origin, for instance of `run_diagnose`, with plots, tables and files.

        Parameters
        ----------
        found
            The diagnosis.
        made_by, seed, own_effects
            As the attributes.
        """
        return cls(**vars(found), made_by=made_by, seed=seed, own_effects=tuple(own_effects))

    def __repr__(self) -> str:
        return f"DiagnosisResult({self.title!r}, verdict={self.verdict!r}, effects={self.effects!r})"

    def _repr_html_(self) -> str:
        return diagnosis_html(self)

    def plot(self, picture: Picture = "gap", record: str | None = None, output: str | None = None) -> Figure:
        """Draw the diagnosis.

        Parameters
        ----------
        picture
            ``"gap"``: how the gap shrinks, step by step. ``"candidates"``: the error of each. ``"record"``: measured and
            simulated output of one record, with the errors below. ``"trust"``: parameters estimated from single records.
        record
            Name of the record, for ``"record"``; by default the first that was scored.
        output
            Name of the output, for ``"record"``; by default the first of the rig.

        Returns
        -------
        A new matplotlib figure.

        Raises
        ------
        InputError
            If there is no such picture, record or output, or no parameter was estimated by record.
        """
        check_option("The picture", picture, get_args(Picture))
        self._check_unused("record", picture, record=record, output=output)
        if picture == "gap":
            return budget_drawing(self)
        if picture == "candidates":
            return ranking_drawing(self)
        if picture == "trust":
            return trust_drawing(self)
        trace = self._chosen("record", record, {trace.record: trace for trace in self.traces})
        name = self._chosen("output", output, {name: name for name in trace.measured})
        return record_drawing(self, trace, name)

    def to_dataframe(self, table: Table = "candidates") -> pd.DataFrame:
        """Return a part of the diagnosis as a table.

        Parameters
        ----------
        table
            ``"candidates"``: a row per set of effects that was tried, best first; errors are NRMSE on the validation records.
            ``"gap"``: a row per output with the NRMSE of each stage. ``"parameters"``: a row per fitted parameter of the
            diagnosed simulation, with its standard error and unit. ``"trust"``: a row per parameter and group (a record, an
            amplitude, windows of a length) with its value there, and how the parameter differs between groups.

        Raises
        ------
        InputError
            If there is no such table, or pandas is not installed.
        """
        check_option("The table", table, get_args(Table))
        if table == "trust":
            return self._frame(trust_rows(self), TRUST_COLUMNS)
        if table == "gap":
            stages = (*STAGES, "noise_floor", "closed")
            gaps = [
                {"output": name, **{s: getattr(gap, s) for s in stages}} for name, gap in self.gap.items()
            ]
            return self._frame(gaps, ("output", *stages))
        if table == "parameters":
            best = named_candidate(self)
            return self._estimates("parameter", {} if best is None else best.parameters)
        rows = [
            {
                "effects": ", ".join(candidate.effects),
                "probability": candidate.probability,
                "error_over_noise": candidate.error_over_noise,
                **{f"nrmse_{output}": error for output, error in candidate.validation_nrmse.items()},
                "converged": candidate.success,
            }
            for candidate in self.candidates
        ]
        return self._frame(rows, ("effects", "probability", "error_over_noise"))

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_together(folder, result_files(self, self.made_by, self.seed, self.own_effects))
