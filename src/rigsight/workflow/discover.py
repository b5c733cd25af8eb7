"""The work of `rigsight discover`: a campaign -> `discovery.json`, `model.json`, a figure, and effects for `--effects`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.diagnose.noise.detection import noise_floors
from rigsight.discover.discovery import discover
from rigsight.discover.records import DiscoveryData
from rigsight.discover.result import LAWS_FILE, SHAPE_FILE, Discovery
from rigsight.effects import Effect
from rigsight.errors import InputError, RigsightError
from rigsight.identify.closed_loop import closed_loop_notes
from rigsight.identify.fit.windows import cut, window_length
from rigsight.plot import svg_text
from rigsight.plot.fitted_numbers import discovery_figure
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.own.effect_checks import failed_checks
from rigsight.workflow.own.own_effects import effect_file
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, Stage, report_notes, silent
from rigsight.workflow.run.results import ELSEWHERE, check_writable, json_text, write_together

DISCOVERY_FILE = "discovery.json"
FIGURE_FILE = "discovery.svg"
DISCOVERING = "Discovering"
_STEPS = 18
"""Approximate number of steps of a discovery; the total grows if there are more."""


def run_discover(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    effects: Sequence[Effect] = (),
    one_by_one: bool = False,
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
) -> Discovery:
    """Discover the governing equations behind the records of a campaign, with effects of the user among the terms."""
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out))
    found = discover_campaign(
        read_campaign(campaign, effects, own_rigs),
        effects=effects,
        one_by_one=one_by_one,
        seed=seed,
        n_jobs=jobs,
        listener=listener,
    )
    if out is not None:
        write_discovery(found, Path(out))
    return found


def check_kept(files: Iterable[Path], out: Path) -> None:
    """Check that no file with effects of the user would be replaced by one that is written."""
    for name in (LAWS_FILE, SHAPE_FILE):
        if any(file.resolve() == (out / name).resolve() for file in files):
            raise InputError(
                f"{out / name} is read for its effects, and a discovery into {out} may replace it. {ELSEWHERE}"
            )


def discover_campaign(
    campaign: Campaign,
    *,
    effects: Sequence[Effect] = (),
    one_by_one: bool = False,
    seed: int = 0,
    n_jobs: int = 1,
    listener: Listener = silent,
) -> Discovery:
    """Discover the governing equations behind the records of a campaign that was read or made of records."""
    data = discovery_data(campaign)
    report_notes(campaign.notes, listener)
    stage = Stage(DISCOVERING, _STEPS, listener)
    # Supports are fitted in parallel; multithreaded matrix products would only compete for the same processors.
    with threadpool_limits(limits=1, user_api="blas"):
        found = _with_usable_laws(discover(data, effects, seed, stage.finished, n_jobs))
        notes = (*campaign.notes, *(note for record in campaign.records for note in record.notes))
        notes += tuple(closed_loop_notes(campaign.records, campaign.rig, "It is not used in a discovery."))
        factor = campaign.open_factor
        notes = notes if factor is None else (factor.sentence, *notes)
        found = replace(
            found,
            warnings=(*found.warnings, *notes),
            given=campaign.given,
            records=campaign.records,
        )
        if not one_by_one:
            return found
        alone = _one_by_one(campaign, data, effects, seed, n_jobs, stage.finished)
        return replace(found, by_record=alone)


def _with_usable_laws(found: Discovery) -> Discovery:
    """Return a discovery whose own effects pass the checks that they meet when a file with them is read."""
    offered = () if found.offered is None else (found.offered.effect,)
    failed = {law.name: failed_checks(law) for law in (*found.own_laws, *offered)}
    notes = [f"{name} is not written as an effect: {own[0]}" for name, own in failed.items() if own]
    return replace(
        found,
        own_laws=tuple(law for law in found.own_laws if not failed[law.name]),
        offered=None if any(failed[law.name] for law in offered) else found.offered,
        warnings=(*found.warnings, *notes),
    )


def discovery_data(campaign: Campaign) -> DiscoveryData:
    """Return the data of a campaign for a discovery; records of a rig that drifts are cut into windows."""
    drifts = campaign.absent_spring is not None
    floors = noise_floors(campaign.rig, campaign.records, drifts=drifts)
    length = window_length(campaign.rig, campaign.estimation) if drifts else None
    return DiscoveryData(
        campaign, {floor.output: floor.std for floor in floors}, cut(campaign.records, length)
    )


def only(data: DiscoveryData, record: Record) -> DiscoveryData:
    """Return the data with one estimation record alone, whole or in windows, and with all validation records."""
    own = tuple(r for r in data.records if r.role == "validation" or r.origin == record.name)
    return replace(data, windows=own)


def write_discovery(found: Discovery, out: Path) -> tuple[Path, ...]:
    """Write all results of a discovery into a folder, all or none."""
    files = {
        DISCOVERY_FILE: json_text(found.to_json()),
        MODEL_FILE: json_text(found.model),
        FIGURE_FILE: svg_text(discovery_figure(found), FIGURE_FILE),
    }
    if found.own_laws:
        about = f"Powers of the equation that 'rigsight discover' found for {found.rig}."
        files[LAWS_FILE] = effect_file(about, {str(law.torque): law for law in found.own_laws})
    if found.offered is not None:
        about = f"The shape of a force that the equation of {found.rig} lacks."
        files[SHAPE_FILE] = effect_file(about, {found.offered.equation: found.offered.effect})
    return write_together(out, files)


def _one_by_one(
    campaign: Campaign,
    data: DiscoveryData,
    effects: Sequence[Effect],
    seed: int,
    n_jobs: int,
    finished: Callable[[str], None],
) -> tuple[tuple[str, Discovery | str], ...]:
    """Discover on each estimation record alone; if that fails, the result is the reason."""

    def alone(record: Record) -> tuple[str, Discovery | str]:
        try:
            # Effects are handed on from all records together.
            return record.name, replace(
                discover(only(data, record), effects, seed), offered=None, own_laws=()
            )
        except RigsightError as error:
            return record.name, str(error)

    found = []
    # Threads suffice: the kernels release the GIL.
    parallel = Parallel(n_jobs=n_jobs, prefer="threads", return_as="generator")
    for name, result in parallel(delayed(alone)(record) for record in campaign.estimation):
        found.append((name, result))
        finished(f"{name} alone")
    return tuple(found)
