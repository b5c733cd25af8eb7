"""What `rigsight discover` does: a campaign -> `discovery.json`, `model.json` and a picture, together."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from rigsight.diagnose.fitting.windows import cut, window_length
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.discover import METHODS, Discovery, Task, discover
from rigsight.discover.discovery import Method
from rigsight.errors import RigsightError, check_option
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.plot import svg_text
from rigsight.plot.discovery import discovery_figure
from rigsight.records import Record
from rigsight.workflow.campaigns.campaign import Campaign, read_campaign
from rigsight.workflow.files.model_file import MODEL_FILE
from rigsight.workflow.files.results import check_writable, json_text, write_together
from rigsight.workflow.kernels import checked_jobs
from rigsight.workflow.not_yet import check_takes
from rigsight.workflow.progress import Listener, Stage, silent

DISCOVERY_FILE = "discovery.json"
FIGURE_FILE = "discovery.svg"
DISCOVERING = "Discovering"
_STEPS = 18
"""About as many as a discovery takes; more raise the total."""


def run_discover(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    method: str = "discrepancy",
    pointwise: bool = False,
    one_by_one: bool = False,
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
) -> Discovery:
    """Discover the governing equations behind the records of a campaign.

    Parameters
    ----------
    campaign
        The toml file or its folder.
    out
        Folder for ``discovery.json``, ``model.json`` and ``discovery.svg``; None writes nothing.
    method
        ``"discrepancy"``: the rig's own terms stand, what they leave is regressed. ``"full"``: the whole acceleration is.
    pointwise
        Regress sample by sample instead of in the weak form.
    one_by_one
        Discover on each estimation record alone as well.
    seed
        Seed of the ensembles.
    n_jobs
        Records discovered on at the same time; None for one per processor.
    listener
        Told of every finished step.

    Raises
    ------
    InputError
        If the campaign or its records cannot be used, or the results cannot be written; nothing is written then.
    SimulationError
        If the rig's own equations cannot be simulated near the records.
    """
    check_option("The method", method, METHODS)
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out))
    found = discover_campaign(
        read_campaign(campaign),
        method,
        pointwise=pointwise,
        one_by_one=one_by_one,
        seed=seed,
        n_jobs=jobs,
        listener=listener,
    )
    if out is not None:
        write_discovery(found, Path(out))
    return found


def discover_campaign(
    campaign: Campaign,
    method: str = "discrepancy",
    *,
    pointwise: bool = False,
    one_by_one: bool = False,
    seed: int = 0,
    n_jobs: int = 1,
    listener: Listener = silent,
) -> Discovery:
    """Discover the governing equations behind the records of a campaign that was read or made of records.

    Parameters
    ----------
    campaign
        The campaign.
    method, pointwise, one_by_one, seed, n_jobs, listener
        As in `run_discover`.

    Raises
    ------
    InputError
        If the method is unknown or the records cannot be used.
    SimulationError
        If the rig's own equations cannot be simulated near the records.
    """
    chosen = cast("Method", check_option("The method", method, METHODS))
    check_takes("discover", campaign.rig, campaign.records)
    task = discovery_task(campaign)
    stage = Stage(DISCOVERING, _STEPS, listener)
    # Supports are fitted side by side; matrix products spread over the same processors would only wait for each other.
    with threadpool_limits(limits=1, user_api="blas"):
        found = discover(task, chosen, pointwise, seed, stage.finished, n_jobs)
        notes = (*campaign.notes, *(note for record in campaign.records for note in record.notes))
        notes += tuple(closed_loop_notes(campaign.records, campaign.rig, "It is not used in a discovery."))
        factor = campaign.open_factor
        notes = notes if factor is None else (factor.sentence, *notes)
        found = replace(found, warnings=(*found.warnings, *notes))
        if not one_by_one:
            return found
        alone = _one_by_one(campaign, task, chosen, pointwise, seed, n_jobs, stage.finished)
        return replace(found, by_record=alone)


def discovery_task(campaign: Campaign) -> Task:
    """Return what is to be discovered in a campaign; records of a rig that drifts are cut into windows.

    Parameters
    ----------
    campaign
        A campaign that was read.
    """
    no_spring = campaign.rig.has_one_motion and campaign.parameters.get("k") == 0.0
    length = window_length(campaign.rig, campaign.estimation) if no_spring else None
    floors = noise_floors(campaign.rig, campaign.records, drifts=no_spring)
    noise = {floor.output: floor.std for floor in floors}
    factor = campaign.open_factor
    return Task(
        title=campaign.title,
        rig=campaign.rig,
        constants=campaign.constants,
        records=cut(campaign.records, length),
        noise=noise,
        has_stiffness=not no_spring,
        held={} if factor is None else {factor.held: factor.value},
    )


def write_discovery(found: Discovery, out: Path) -> tuple[Path, ...]:
    """Write all results of a discovery into a folder, all or none.

    Raises
    ------
    InputError
        If they cannot be written.
    """
    return write_together(
        out,
        {
            DISCOVERY_FILE: json_text(found.to_json()),
            MODEL_FILE: json_text(found.model),
            FIGURE_FILE: svg_text(discovery_figure(found), FIGURE_FILE),
        },
    )


def _one_by_one(
    campaign: Campaign,
    task: Task,
    method: Method,
    pointwise: bool,
    seed: int,
    n_jobs: int,
    finished: Callable[[str], None],
) -> tuple[tuple[str, Discovery | str], ...]:
    """Discover on each estimation record alone; where that fails, the reason stands in its place."""

    def alone(record: Record) -> tuple[str, Discovery | str]:
        own = [r for r in task.records if r.role == "validation" or r.name.startswith(record.name)]
        try:
            return record.name, discover(replace(task, records=tuple(own)), method, pointwise, seed)
        except RigsightError as error:
            return record.name, str(error)

    found = []
    # Threads: the kernels let others run.
    parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
    for name, result in parallel(delayed(alone)(record) for record in campaign.estimation):
        found.append((name, result))
        finished(f"{name} alone")
    return tuple(found)
