"""Write the outcomes of one or several benches as `blind.json` and `blind.html`."""

from __future__ import annotations

import os
import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rigsight.errors import InputError
from rigsight.workflow.run.results import REPORT_FILE, check_writable, json_text, versions, write_together
from rigsight_bench.report.markdown import blind_markdown
from rigsight_bench.report.page import render_blind
from rigsight_bench.running.files import EXTERNAL, STORE_FILE, BenchFolder, read_json
from rigsight_bench.running.store import TrialStore, collector_paused
from rigsight_bench.scoring import Outcome, summary

BLIND_FILE = "blind.json"
PAGE_FILE = "blind.html"
MOST_LISTED = 2_000
"""Largest number of trials for which ``blind.json`` contains every outcome; beyond, only ``trials.sqlite`` does."""
_DETAILS = ("withheld", "parameters", "version", "fingerprint", "right")
"""Fields that are left out in the list of wrong trials."""


@dataclass(frozen=True)
class Scored:
    """An outcome and its bench."""

    outcome: Outcome
    folder: Path


def write_score(out: Path, scored: Sequence[Scored], command: str) -> dict[str, Any]:
    """Write ``blind.json`` and ``blind.html`` of these trials and return the content of the first.

    Parameters
    ----------
    out
        Folder.
    scored
        All trials.
    command
        The command line that the score quotes.

    Raises
    ------
    InputError
        If the files cannot be written.
    """
    outcomes = [one.outcome for one in scored]
    benches = Counter((o.design, o.seed) for o in outcomes)
    settings = {folder: _settings(folder) for folder in {one.folder for one in scored}}
    content = {
        "schema_version": 2,
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": command,
        "versions": versions(),
        "n_trials": len(outcomes),
        "benches": [
            {"design": design, "seed": seed, "n_trials": count} for (design, seed), count in benches.items()
        ],
        **summary(outcomes),
        "wrong": [_wrong(one, out, settings[one.folder]) for one in scored if not one.outcome.right],
        "trials": [o.to_json() for o in outcomes] if len(outcomes) <= MOST_LISTED else None,
    }
    write_together(out, {BLIND_FILE: json_text(content), PAGE_FILE: render_blind(content)})
    return content


def write_markdown(file: Path, content: dict[str, Any]) -> None:
    """Write a score as Markdown.

    Parameters
    ----------
    file
        Where to; replaced.
    content
        The content of ``blind.json``.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    write_together(file.parent, {file.name: blind_markdown(content)})


@collector_paused()
def score_bench(folder: Path, store: TrialStore, command: str) -> dict[str, Any]:
    """Write the score of all rows of a bench into its folder and return the content of ``blind.json``."""
    return write_score(folder, [Scored(outcome, folder) for outcome in store.outcomes()], command)


@collector_paused()
def merge(benches: Sequence[str | Path], out: str | Path, command: str = "rigsight blind") -> dict[str, Any]:
    """Score several benches as one; a trial that is in more than one of them counts once, with the outcome of the first.

    Parameters
    ----------
    benches
        Folders of benches, whole or parts.
    out
        Folder for the score of all; none of the benches.
    command
        The command line that the score quotes.

    Raises
    ------
    InputError
        If a bench has no scored trials, or the score would replace that of one of them.
    """
    found: dict[tuple[str, int, str, str], Scored] = {}
    target = Path(out)
    check_writable(target)
    for bench in map(Path, benches):
        file = bench / STORE_FILE
        if not file.is_file():
            raise InputError(
                f"{bench} contains no scored trials ({STORE_FILE}). Score its diagnosed trials with "
                f"'rigsight blind --rescore --out {shlex.quote(str(bench))}'."
            )
        if bench.resolve() == target.resolve():
            raise InputError(
                f"The combined score would overwrite the score of {bench}. Name another folder with --out."
            )
        with TrialStore(file) as store:
            for outcome in store.outcomes():
                identity = (outcome.design, outcome.seed, outcome.trial, outcome.fingerprint)
                found.setdefault(identity, Scored(outcome, bench))
    return write_score(target, list(found.values()), command)


def _settings(bench: Path) -> dict[str, Any]:
    file = BenchFolder(bench).settings
    return read_json(file) if file.is_file() else {}


def _wrong(one: Scored, out: Path, settings: dict[str, Any]) -> dict[str, Any]:
    """Return a wrong trial with the path of its report, relative to the score, and the command that runs this trial alone."""
    report = BenchFolder(one.folder).result(one.outcome.trial) / REPORT_FILE
    shown = [field.name for field in fields(Outcome) if field.name not in _DETAILS]
    return {
        **{name: getattr(one.outcome, name) for name in shown},
        "report": Path(os.path.relpath(report, out)).as_posix() if report.is_file() else None,
        "again": _again(one.outcome, settings),
    }


def _again(found: Outcome, settings: dict[str, Any]) -> str:
    if found.design == EXTERNAL:
        where = ["--campaigns", settings.get("campaigns", "DIR"), "--keys", settings.get("keys", "DIR")]
        return shlex.join(["rigsight", "blind", *where, "--trial", found.trial, "--out", "DIR"])
    folder = f" {shlex.quote(settings['folder'])}" if "folder" in settings else ""
    which = f"--seed {found.seed} --trial {int(found.trial)}"
    return f"rigsight blind --design {found.design}{folder} {which} --out DIR"
