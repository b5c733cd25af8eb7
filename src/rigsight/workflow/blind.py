"""What `rigsight blind` does: drawn rigs whose effect is withheld are diagnosed, and scored by keys no diagnosis has seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from rigsight.blind import Design, Outcome, n_trials, summary
from rigsight.errors import InputError
from rigsight.workflow.blind_files import BenchFolder
from rigsight.workflow.blind_trial import diagnose_trial, make_trial, score_trial
from rigsight.workflow.diagnose import versions
from rigsight.workflow.kernels import checked_jobs
from rigsight.workflow.progress import Listener, Stage, silent
from rigsight.workflow.results import check_writable, json_text, write_together

BLIND_FILE = "blind.json"
RUNNING = "Blind trials"


def run_blind(
    out: str | Path,
    *,
    design: Design = "standard",
    trials: int | None = None,
    seed: int = 0,
    only: Sequence[int] = (),
    n_jobs: int | None = None,
    listener: Listener = silent,
    command: str = "rigsight blind",
) -> dict[str, Any]:
    """Draw, diagnose and score blind trials; what an earlier run of the same bench has finished is kept.

    Parameters
    ----------
    out
        Folder for the bench.
    design
        List of cells to draw from: ``"small"`` or ``"standard"``.
    trials
        Number of trials; None for one of every cell.
    seed
        Seed of all draws.
    only
        Numbers of the trials to run; all if empty. The score covers every trial that is diagnosed.
    n_jobs
        Trials at the same time; None for one per processor.
    listener
        Told of every finished trial.
    command
        The command line that the score quotes.

    Returns
    -------
    The content of ``blind.json``.

    Raises
    ------
    InputError
        If the folder holds another bench or cannot be written, or a number is out of range.
    RigsightError
        If a trial cannot be drawn, or its diagnosis was ended from outside.
    """
    jobs = checked_jobs(n_jobs)
    total = n_trials(design) if trials is None else trials
    if total < 1 or any(not 0 <= number < total for number in only):
        raise InputError(
            f"Trials are numbered from 0 to {total - 1}, got {', '.join(map(str, only)) or total}."
        )
    folder = BenchFolder(Path(out))
    check_writable(folder.path)
    folder.settle(design, seed)
    numbers = list(only) or list(range(total))
    waiting = [number for number in numbers if not folder.diagnosed(number)]
    stage = Stage(RUNNING, len(numbers), listener)
    for number in numbers:
        if number not in waiting:
            stage.finished(f"{number} (done before)")
    parallel = Parallel(n_jobs=min(jobs, max(1, len(waiting))), return_as="generator_unordered", batch_size=1)
    for number in parallel(delayed(_run_trial)(folder, design, seed, number) for number in waiting):
        stage.finished(str(number))
    diagnosed = [number for number in range(total) if folder.diagnosed(number)]
    outcomes = list(
        Parallel(n_jobs=min(jobs, max(1, len(diagnosed))))(delayed(score_trial)(folder, n) for n in diagnosed)
    )
    content = _content(folder, design, seed, outcomes, command)
    write_together(folder.path, {BLIND_FILE: json_text(content)})
    return content


def _run_trial(folder: BenchFolder, design: Design, seed: int, number: int) -> int:
    make_trial(folder, design, seed, number)
    diagnose_trial(folder, number)
    return number


def _content(
    folder: BenchFolder, design: Design, seed: int, outcomes: Sequence[Outcome], command: str
) -> dict[str, Any]:
    wrong = [
        {
            "trial": found.trial,
            "report": str(folder.result(found.trial).relative_to(folder.path) / "report.html"),
            "again": f"rigsight blind --design {design} --seed {seed} --trial {found.trial} --out DIR",
        }
        for found in outcomes
        if not found.right
    ]
    return {
        "schema_version": 1,
        "design": design,
        "seed": seed,
        "n_trials": len(outcomes),
        "command": command,
        "versions": versions(),
        **summary(outcomes),
        "wrong": wrong,
        "trials": [found.to_json() for found in outcomes],
    }
