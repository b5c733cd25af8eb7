"""Comparison of models with the records of a campaign from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rigsight.api.results import Result
from rigsight.campaign import Campaign
from rigsight.compare import Comparison, Competitor
from rigsight.report.comparison import comparison_html, overall_figure, record_figures
from rigsight.simulate.model import Model
from rigsight.workflow.campaign.in_memory import campaign_of
from rigsight.workflow.campaign.model_file import of_this_rig
from rigsight.workflow.compare import compare_campaign, named_competitors, write_comparison
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import listening

if TYPE_CHECKING:
    import pandas as pd

    from rigsight.plot import Figure


def compare_models(
    campaign: Campaign | str | Path,
    models: Mapping[str, Model] | Sequence[str | Path],
    *,
    method: str = "local_rational",
    step_seconds: float = 4.0,
    n_jobs: int | None = None,
    verbose: bool = False,
) -> ComparisonResult:
    """Score models on all records of a campaign: frequency responses, steps and free runs, each with its noise floor.

    What ``rigsight compare`` does.

    Parameters
    ----------
    campaign
        A campaign, or the toml file or the folder that contains one.
    models
        Name -> model; or files, folders and names of published sets, as on the command line.
    method
        Estimator of all frequency responses: ``"local_rational"``, ``"local_polynomial"``, ``"h1"`` or ``"thesis"``.
    step_seconds
        Time after a step over which it is compared [s].
    n_jobs
        Records compared at the same time; None for one per processor.
    verbose
        Show progress on stderr.

    Raises
    ------
    InputError
        If the campaign or a model cannot be used, a model is of another rig, or none can be simulated on any record.

    Examples
    --------
    >>> import rigsight as rs
    >>> campaign = rs.example_campaign()
    >>> given = {"m": 2.0, "d": 5.0, "k": 800.0}
    >>> models = {
    ...     "given": rs.make_model("axis", given),
    ...     "hardening": rs.make_model("axis", {**given, "k_3": 5e6}, ["cubic_stiffness"]),
    ... }
    >>> compared = rs.compare_models(campaign, models, n_jobs=1)
    >>> free_run = [score for score in compared.scores if score.column.quantity == "free_run_nrmse"]
    >>> min(free_run, key=lambda score: score.value).model
    'hardening'
    """
    read = campaign_of(campaign)
    jobs = checked_jobs(n_jobs)
    if isinstance(models, Mapping):
        competitors = [
            Competitor(name, of_this_rig(name, model, read), name) for name, model in models.items()
        ]
    else:
        competitors = named_competitors(models, read)
    with listening(quiet=not verbose) as listener:
        found = compare_campaign(read, competitors, method, step_seconds, jobs, listener)
    return ComparisonResult.of(found, made_by=f"rigsight.compare_models(..., method={method!r})")


@dataclass(frozen=True, eq=False)
class ComparisonResult(Result, Comparison):
    """The result of a comparison, as it is in ``comparison.json``; saved with ``.csv``, ``.html`` and the figures.

    Attributes
    ----------
    made_by
        The command or call that made it; quoted in the page.
    """

    made_by: str = "rigsight"

    @classmethod
    def of(cls, found: Comparison, made_by: str = "rigsight") -> Self:
        """Return a comparison of any origin, for instance of `run_compare`, with plots, tables and files.

        Parameters
        ----------
        found
            The comparison.
        made_by
            As the attribute.
        """
        return cls(**vars(found), made_by=made_by)

    def __repr__(self) -> str:
        models = [competitor.name for competitor in self.competitors]
        return f"ComparisonResult({self.title!r}, models={models!r}, records={len(self.records)})"

    def _repr_html_(self) -> str:
        return comparison_html(self)

    def plot(self, record: str | None = None) -> Figure:
        """Draw the comparison.

        Parameters
        ----------
        record
            Name of a record, to draw its frequency responses, or its step; None for the errors over all records.

        Returns
        -------
        A new matplotlib figure.

        Raises
        ------
        InputError
            If there is no such record, or it shows neither a response nor a step.
        """
        if record is None:
            return overall_figure(self).drawing
        index = self._chosen("record", record, {own.record.name: i for i, own in enumerate(self.records)})
        drawings = {f"picture of '{record}'": figure.drawing for figure in record_figures(self, index)}
        return self._chosen(f"picture of '{record}'", None, drawings)

    def to_dataframe(self) -> pd.DataFrame:
        """Return every error as a row: model, record, quantity, signal, unit, value, noise floor, lines or samples.

        Raises
        ------
        InputError
            If pandas is not installed.
        """
        columns = ("model", "record", "quantity", "signal", "unit", "value", "noise_floor", "n_values")
        rows = ({**vars(score.column), **vars(score)} for score in self.scores)
        return self._frame(({name: row[name] for name in columns} for row in rows), columns)

    def _write(self, folder: Path) -> tuple[Path, ...]:
        return write_comparison(self, folder, self.made_by)
