"""Draw one blind trial, and diagnose it in a process that gets only its campaign."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rigsight.errors import MachineError, RigsightError
from rigsight.workflow.run.results import json_text
from rigsight_bench.running.files import RUN_FILE, BenchFolder, trial_name
from rigsight_bench.trials import Design, draw_trial

_KEPT_VARIABLES = (
    "PATH",
    "HOME",
    "LANG",
    "LC_ALL",
    "TMPDIR",
    "TEMP",
    "SYSTEMROOT",
    "LOCALAPPDATA",
    "USERPROFILE",
    "XDG_CACHE_HOME",
    "RIGSIGHT_CACHE_DIR",
)
"""Environment variables that the process of a diagnosis gets; it gets no others."""
_FAILURES = (1, 2)
"""Exit codes of a diagnosis that ended by itself; other exit codes say nothing about the trial."""
MACHINE = 75
"""Exit code of a diagnosis that failed because of this machine: a full disk, too little memory."""


def make_trial(
    folder: BenchFolder, design: Design, seed: int, number: int, measured: Path | None = None
) -> None:
    """Draw a trial and write it, unless that has been done.

    Parameters
    ----------
    folder
        The bench.
    design, seed, number
        Which trial.
    measured
        Folder of the campaigns of design ``measured``.

    Raises
    ------
    RigsightError
        If it cannot be drawn or written.
    """
    name = trial_name(number)
    if not folder.drawn(name):
        folder.write_trial(name, draw_trial(design, seed, number, measured))


def diagnose_trial(folder: BenchFolder, name: str, start: Sequence[str]) -> None:
    """Diagnose a trial in a process of its own, unless that has been done.

    The process works on a copy in a temporary folder, so that not even its path reveals which trial it is or where the keys are.

    Parameters
    ----------
    folder
        The bench.
    name
        Which trial.
    start
        Arguments with which Python starts the command line.

    Raises
    ------
    RigsightError
        If the process was ended from outside, or found no room on the disk or in memory.
    """
    if folder.diagnosed(name):
        return
    fingerprint = folder.fingerprint(name)
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="rigsight-") as place:
        _copy(folder.campaign(name), Path(place) / "campaign")
        run = subprocess.run(
            [
                sys.executable,
                "-I",
                *start,
                "diagnose",
                "campaign",
                "--out",
                "results",
                "--jobs",
                "1",
                "--quiet",
            ],
            cwd=place,
            env=_environment(),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if run.returncode == MACHINE:
            raise MachineError(f"Trial {name} cannot be diagnosed on this machine: {run.stderr.strip()}")
        if run.returncode not in (0, *_FAILURES):
            raise RigsightError(
                f"The diagnosis of trial {name} was ended from outside (exit code {run.returncode}); "
                "the same command continues the bench."
            )
        seconds = time.perf_counter() - begin
        about = {
            "seconds": round(seconds, 2),
            "message": (run.stderr if run.returncode else "").strip(),
            "fingerprint": fingerprint,
        }
        _keep(Path(place) / "results", folder.result(name), about)


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    return {**kept, "OPENBLAS_NUM_THREADS": "1"}


def _keep(found: Path, target: Path, about: dict[str, Any]) -> None:
    """Move results into the bench so that they appear there as a whole."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".part-", dir=target.parent) as part:
        place = Path(part) / "results"
        if found.is_dir():
            _copy(found, place)
        else:
            place.mkdir()
        (place / RUN_FILE).write_text(json_text(about), encoding="utf-8")
        if target.exists():
            shutil.rmtree(target)
        place.rename(target)


def _copy(folder: Path, target: Path) -> None:
    """Copy a folder; unlike shutil.copytree, stop at the first file that cannot be written and raise its error.

    File times are not copied: those of a campaign would reveal how long its parts were simulated.
    """
    target.mkdir()
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            _copy(path, target / path.name)
        else:
            shutil.copy(path, target / path.name)
