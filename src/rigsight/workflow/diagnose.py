"""The work of `rigsight diagnose`: a campaign -> `diagnosis.json`, `model.json` and `report.html`."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.diagnose import Diagnosis, diagnose, structures_to_fit
from rigsight.effects import CATALOGUE, Effect
from rigsight.report import render_report
from rigsight.rigs import Rig
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.own.effect_names import candidates_of
from rigsight.workflow.run.fit_journal import FitJournal
from rigsight.workflow.run.json_file import versions
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels, structures_to_try
from rigsight.workflow.run.progress import Listener, Stage, Step, silent, tell
from rigsight.workflow.run.results import (
    DIAGNOSIS_FILE,
    REPORT_FILE,
    check_writable,
    json_text,
    write_together,
)

DIAGNOSING = "Diagnosing"
# Noise floor, re-identified equations and the given simulation, before the candidates.
_STEPS_BEFORE_CANDIDATES = 3


def run_diagnose(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    effects: Sequence[Effect] = CATALOGUE,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    seed: int = 0,
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str | None = None,
) -> Diagnosis:
    """Diagnose the gap between the simulation that a campaign gives and its records.

    Fits of an interrupted diagnosis of the same campaign are reused; the listener gets a step that says so.
    """
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out), DIAGNOSIS_FILE, MODEL_FILE, REPORT_FILE)

    def keep(diagnosis: Diagnosis) -> None:
        if out is not None:
            called = command or f"rigsight diagnose {shlex.quote(str(campaign))}"
            write_diagnosis(diagnosis, Path(out), called, seed, (*effects, *own_effects))

    return diagnose_campaign(
        read_campaign(campaign, own_effects, own_rigs), effects, seed, jobs, listener, keep
    )


def diagnose_campaign(
    campaign: Campaign,
    effects: Sequence[Effect] = CATALOGUE,
    seed: int = 0,
    n_jobs: int = 1,
    listener: Listener = silent,
    keep: Callable[[Diagnosis], None] | None = None,
) -> Diagnosis:
    """Diagnose the gap between the simulation that a campaign gives and its records."""
    tell(campaign.notes, listener)
    candidates = candidates_of(campaign, effects)
    tried = structures_to_try(campaign.rig, candidates, campaign.modelled)
    prepare_kernels(structures_to_fit(campaign, tried), n_jobs, listener)
    stage = Stage(DIAGNOSING, _STEPS_BEFORE_CANDIDATES + len(candidates), listener)
    journal = (
        contextlib.nullcontext()
        if campaign.path is None
        else FitJournal(campaign.path, lambda count: _tell_going_on(count, listener))
    )
    # Candidates are fitted in parallel; multithreaded matrix products would only compete for the same processors.
    with threadpool_limits(limits=1, user_api="blas"), journal as memory:
        diagnosis = diagnose(
            campaign,
            candidates,
            seed=seed,
            n_jobs=n_jobs,
            progress=stage.finished,
            prepare=lambda structures: prepare_kernels(structures, n_jobs, listener),
            memory=memory,
        )
        if keep is not None:
            keep(diagnosis)
        return diagnosis


def _tell_going_on(count: int, listener: Listener) -> None:
    """Report that an interrupted diagnosis is continued; its results are the same and do not mention it."""
    stage = f"Continuing: {count} fit{'' if count == 1 else 's'} done before the interruption"
    listener(Step(stage, "", 0, count))
    listener(Step(stage, "", count, count))


def write_diagnosis(
    diagnosis: Diagnosis, out: Path, command: str, seed: int | None, effects: Iterable[Effect] = CATALOGUE
) -> tuple[Path, ...]:
    """Write the three results of a diagnosis into a folder, all or none; the report shows the equations of these effects."""
    return write_together(out, result_files(diagnosis, command, seed, effects))


def result_files(
    diagnosis: Diagnosis, command: str, seed: int | None, effects: Iterable[Effect] = CATALOGUE
) -> dict[str, str]:
    """Return the three results of a diagnosis by file name."""
    return {
        DIAGNOSIS_FILE: json_text(diagnosis.to_json()),
        MODEL_FILE: json_text(diagnosis.model),
        REPORT_FILE: render_report(
            diagnosis, command=command, versions=versions(), seed=seed, own_effects=effects
        ),
    }
