"""The work of `rigsight blind`: trials whose true effect is withheld are diagnosed and scored with sealed keys."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from rigsight.errors import InputError, nearest
from rigsight.workflow.run.kernels import checked_jobs
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable
from rigsight_bench.running.execution import finished
from rigsight_bench.running.external import ExternalBench
from rigsight_bench.running.files import EXTERNAL, STORE_FILE, BenchFolder, read_json, trial_name
from rigsight_bench.running.score_files import score_bench
from rigsight_bench.running.scoring import score_trial
from rigsight_bench.running.store import TrialStore
from rigsight_bench.running.trial import diagnose_trial, make_trial
from rigsight_bench.scoring import Outcome
from rigsight_bench.trials import Design, n_trials

RUNNING = "Blind trials"
SCORING = "Scoring trials again"


def run_blind(
    out: str | Path,
    *,
    start: Sequence[str],
    design: Design = "standard",
    measured: Path | None = None,
    trials: int | None = None,
    seed: int = 0,
    only: Sequence[int] = (),
    n_jobs: int | None = None,
    cluster: str | None = None,
    listener: Listener = silent,
    command: str = "rigsight blind",
) -> dict[str, Any]:
    """Draw, diagnose and score blind trials; trials that an earlier run of the same bench has finished are kept.

    Parameters
    ----------
    out
        Folder for the bench.
    start
        Arguments with which Python starts the command line of a trial: ``rigsight_bench.trial_process.START``.
    design
        List of cells to draw from: ``"standard"``, ``"laboratory"`` for records as laboratories take them, or ``"handwritten"``
        for plants that are composed from no declaration, or ``"measured"`` for known causes in measured records.
    measured
        Folder of the campaigns of design ``"measured"``; None with other designs.
    trials
        Number of trials; None for one of every cell.
    seed
        Seed of all draws.
    only
        Numbers of the trials to run; all if empty. The score covers every trial that has been scored.
    n_jobs
        Trials at the same time; None for one per processor.
    cluster
        Address of a Dask scheduler; None for this machine.
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
    n_cells = n_trials(design, measured)
    total = n_cells if trials is None else trials
    if total < 1 or any(not 0 <= number < total for number in only):
        raise InputError(
            f"Trials are numbered from 0 to {total - 1}, got {', '.join(map(str, only)) or total}."
        )
    folder = BenchFolder(Path(out).resolve())
    check_writable(folder.path)
    folder.settle(design, seed, measured)
    numbers = list(only) or list(range(total))
    with TrialStore(folder.path / STORE_FILE) as store:
        scored = store.scored()
        waiting = [number for number in numbers if trial_name(number) not in scored]
        stage = Stage(RUNNING, len(numbers), listener)
        for number in numbers:
            if trial_name(number) in scored:
                stage.finished(f"{number} (done before)")
        run_one = functools.partial(_run_drawn, folder, design, seed, start, measured)
        for outcome in finished(run_one, waiting, jobs, cluster, folder=folder.path, say=_say(listener)):
            store.add([outcome])
            stage.finished(outcome.trial)
        return score_bench(folder.path, store, command)


def run_external(
    campaigns: str | Path,
    keys: str | Path,
    out: str | Path,
    *,
    start: Sequence[str],
    only: Sequence[str] = (),
    n_jobs: int | None = None,
    cluster: str | None = None,
    listener: Listener = silent,
    command: str = "rigsight blind",
) -> dict[str, Any]:
    """Diagnose and score existing campaigns; one that has changed since it was scored is diagnosed again.

    Parameters
    ----------
    campaigns
        Folder with a folder for each campaign.
    keys
        Folder with a key ``NAME.json`` for each of these folders; see `blind_external`.
    out
        Folder for the results.
    start
        As for `run_blind`.
    only
        Names of the campaigns to run; all if empty.
    n_jobs, cluster, listener, command
        As for `run_blind`.

    Returns
    -------
    The content of ``blind.json``.

    Raises
    ------
    InputError
        If a campaign or a key cannot be used, or the results cannot be written.
    RigsightError
        If a diagnosis was ended from outside.
    """
    jobs = checked_jobs(n_jobs)
    folder = ExternalBench(Path(out).resolve(), Path(campaigns).resolve(), Path(keys).resolve())
    check_writable(folder.path)
    names = folder.names()
    for name in only:
        if name not in names:
            raise InputError(f"There is no campaign '{name}' in {folder.campaigns}.{nearest(name, names)}")
    folder.settle_here()
    wanted = list(only) or names
    with TrialStore(folder.path / STORE_FILE) as store:
        scored = store.scored()
        waiting = [name for name in wanted if scored.get(name) != folder.fingerprint(name)]
        stage = Stage(RUNNING, len(wanted), listener)
        for name in wanted:
            if name not in waiting:
                stage.finished(f"{name} (done before)")
        for outcome in finished(
            functools.partial(_run, folder, start),
            waiting,
            jobs,
            cluster,
            folder=folder.path,
            say=_say(listener),
        ):
            store.add([outcome])
            stage.finished(outcome.trial)
        return score_bench(folder.path, store, command)


def rescore(
    out: str | Path,
    *,
    n_jobs: int | None = None,
    cluster: str | None = None,
    listener: Listener = silent,
    command: str = "rigsight blind --rescore",
) -> dict[str, Any]:
    """Score every diagnosed trial of a bench again; nothing is drawn or diagnosed.

    Parameters
    ----------
    out
        Folder of the bench, drawn or of existing campaigns.
    n_jobs, cluster, listener, command
        As for `run_blind`.

    Returns
    -------
    The content of ``blind.json``.

    Raises
    ------
    InputError
        If the folder contains no bench, or key or results of a trial cannot be read.
    """
    jobs = checked_jobs(n_jobs)
    folder = BenchFolder(Path(out).resolve())
    if not folder.settings.is_file():
        raise InputError(f"{out} does not contain a blind bench. Name the folder of the bench with --out.")
    settings = read_json(folder.settings)
    if settings.get("design") == EXTERNAL:
        folder = ExternalBench(folder.path, Path(settings["campaigns"]), Path(settings["keys"]))
    names = folder.all_diagnosed()
    with TrialStore(folder.path / STORE_FILE) as store:
        stage = Stage(SCORING, len(names), listener)
        run_one: Callable[[str], Outcome] = functools.partial(score_trial, folder)
        for outcome in finished(run_one, names, jobs, cluster, folder=folder.path, say=_say(listener)):
            store.add([outcome])
            stage.finished(outcome.trial)
        return score_bench(folder.path, store, command)


def _run_drawn(
    folder: BenchFolder, design: Design, seed: int, start: Sequence[str], measured: Path | None, number: int
) -> Outcome:
    make_trial(folder, design, seed, number, measured)
    return _run(folder, start, trial_name(number))


def _run(folder: BenchFolder, start: Sequence[str], name: str) -> Outcome:
    """Diagnose a trial, unless that has been done, and score it."""
    diagnose_trial(folder, name, start)
    return score_trial(folder, name)


def _say(listener: Listener) -> Callable[[str], None]:
    """Return a function that reports to a listener that trials are waiting, as a stage of its own."""

    def say(words: str) -> None:
        Stage(words, 1, listener)

    return say
