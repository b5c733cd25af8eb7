"""Comparison of models with the records of a campaign from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from rigsight.api.comparison_result import ComparisonResult
from rigsight.api.estimator import campaign_of
from rigsight.campaign import Campaign
from rigsight.compare import Competitor
from rigsight.simulate.model import Model
from rigsight.workflow.compare import compare_campaign, named_competitors, of_this_rig
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress_display import listening


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
