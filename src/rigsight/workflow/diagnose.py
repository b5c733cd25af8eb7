"""The work of `rigsight diagnose`: a campaign -> `diagnosis.json`, `model.json` and `report.html`.

Finished fits are kept in a journal on disk, beside the compiled kernels: an interrupted diagnosis is continued from there.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import shlex
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from threadpoolctl import threadpool_limits

from rigsight.campaign import Campaign
from rigsight.check.remarks import WARNING
from rigsight.diagnose.diagnosis import diagnose
from rigsight.diagnose.fit_context import structures_to_fit
from rigsight.diagnose.result import Diagnosis
from rigsight.effects import CATALOGUE, Effect
from rigsight.report.render import render_report
from rigsight.rigs import Rig
from rigsight.simulate import cache_folder
from rigsight.workflow.campaign.model_file import MODEL_FILE
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.check import CHECK_FILE, CHECK_PAGE, check_files, check_of
from rigsight.workflow.own.own_effects import candidates_of
from rigsight.workflow.reproduce import origin, sealed
from rigsight.workflow.run.kernels import checked_jobs, prepare_kernels, structures_to_try
from rigsight.workflow.run.progress import Listener, Stage, Step, report_notes, silent
from rigsight.workflow.run.results import (
    DIAGNOSIS_FILE,
    REPORT_FILE,
    check_writable,
    json_text,
    versions,
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
    by: str = "",
) -> Diagnosis:
    """Diagnose the gap between the simulation that a campaign gives and its records; `by` signs the report.

    Fits of an interrupted diagnosis of the same campaign are reused; the listener gets a step that says so.
    """
    jobs = checked_jobs(n_jobs)
    if out is not None:
        check_writable(Path(out), DIAGNOSIS_FILE, MODEL_FILE, REPORT_FILE, CHECK_FILE, CHECK_PAGE)

    called = command or f"rigsight diagnose {shlex.quote(str(campaign))}"
    read = read_campaign(campaign, own_effects, own_rigs)
    if out is None:
        return diagnose_campaign(read, effects, seed, jobs, listener)
    folder, check = Path(out), check_of(read, effects, listener)
    # Whoever reads that a record is faulty, or was not read as meant, need not wait for the verdict.
    follows = [note.removeprefix(WARNING) for note in read.notes]
    report_notes((note for note in check.before_a_fit if note not in follows), listener)

    def keep(diagnosis: Diagnosis) -> None:
        made_from = origin(read, diagnosis, called, folder, by)
        results = result_files(diagnosis, called, seed, (*effects, *own_effects), made_from)
        write_together(folder, {**check_files(check, called), **results})

    return diagnose_campaign(read, effects, seed, jobs, listener, keep)


def diagnose_campaign(
    campaign: Campaign,
    effects: Sequence[Effect] = CATALOGUE,
    seed: int = 0,
    n_jobs: int = 1,
    listener: Listener = silent,
    keep: Callable[[Diagnosis], None] | None = None,
) -> Diagnosis:
    """Diagnose the gap between the simulation that a campaign gives and its records."""
    report_notes(campaign.notes, listener)
    candidates = candidates_of(campaign, effects)
    tried = structures_to_try(campaign.rig, candidates, campaign.modelled)
    prepare_kernels(structures_to_fit(campaign, tried), n_jobs, listener)
    stage = Stage(DIAGNOSING, _STEPS_BEFORE_CANDIDATES + len(candidates), listener)
    journal = (
        contextlib.nullcontext()
        if campaign.path is None
        else FitJournal(campaign.path, lambda count: _report_continuation(count, listener))
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


def _report_continuation(count: int, listener: Listener) -> None:
    """Report that an interrupted diagnosis is continued; its results are the same and do not mention it."""
    stage = f"Continuing: {count} fit{'' if count == 1 else 's'} done before the interruption"
    listener(Step(stage, "", 0, count))
    listener(Step(stage, "", count, count))


def result_files(
    diagnosis: Diagnosis,
    command: str,
    seed: int | None,
    effects: Iterable[Effect] = CATALOGUE,
    made_from: Mapping[str, Any] | None = None,
) -> dict[str, str]:
    """Return the three results of a diagnosis by file name; the report shows the equations of these effects."""
    return {
        DIAGNOSIS_FILE: json_text(diagnosis.to_json()),
        MODEL_FILE: json_text(diagnosis.model),
        REPORT_FILE: sealed(
            render_report(diagnosis, command, versions(), seed=seed, own_effects=effects, origin=made_from)
        ),
    }


class FitJournal:
    """The fits of one diagnosis, kept on disk until it is done.

    Used as a context: the file is removed if the context ends without an error, otherwise it is kept.
    """

    def __init__(self, campaign: Path, going_on: Callable[[int], None]) -> None:
        name = hashlib.sha256(
            f"{version('rigsight')} {campaign.resolve()}".encode("utf-8", "surrogatepass")
        ).hexdigest()[:24]
        self._path = cache_folder() / "unfinished" / f"{name}.jsonl"
        self._known: dict[str, Mapping[str, Any]] = {}
        self._own: dict[str, Mapping[str, Any]] = {}
        self._lock = threading.Lock()
        self._going_on = going_on
        self._goes_on = False

    def __enter__(self) -> Self:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            lines = self._path.read_text(encoding="utf-8").splitlines() if self._path.exists() else []
        except (OSError, UnicodeDecodeError):
            lines = []
        for line in lines:
            try:
                entry = json.loads(line)
                self._known[entry["key"]] = _checked(entry)
            except (ValueError, KeyError, TypeError, RecursionError):
                continue
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            with contextlib.suppress(OSError):
                self._path.unlink()

    def recall(self, key: str) -> Mapping[str, Any] | None:
        """Return the outcome stored under a key, also of a fit of this process; None if there is none."""
        found = self._known.get(key)
        if found is None:
            return self._own.get(key)
        with self._lock:
            # Not earlier: a campaign that was changed since has the same path but none of these fits.
            is_first, self._goes_on = not self._goes_on, True
        if is_first:
            self._going_on(len(self._known))
        return found

    def remember(self, key: str, outcome: Mapping[str, Any]) -> None:
        """Append an outcome; if it cannot be written, the diagnosis continues without it."""
        self._own[key] = outcome
        line = json.dumps({"key": key, **outcome}) + "\n"
        with self._lock, contextlib.suppress(OSError), self._path.open("a", encoding="utf-8") as file:
            file.write(line)


def _checked(entry: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an entry whose parts have the types that a fit needs."""
    return {
        "theta": [float(value) for value in entry["theta"]],
        "success": bool(entry["success"]),
        "message": str(entry["message"]),
        "evaluations": int(entry["evaluations"]),
        "substeps": [int(value) for value in entry["substeps"]],
    }
