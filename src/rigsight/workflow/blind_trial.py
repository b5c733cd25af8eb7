"""What happens to one blind trial: drawn, diagnosed in a process that gets the campaign alone, scored by its key."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.blind import Design, Outcome, draw_trial, outcome
from rigsight.effects import Place
from rigsight.errors import RigsightError, SimulationError
from rigsight.identify import GreyBoxFit, characteristic_scales
from rigsight.records import Record, read_record
from rigsight.simulate import simulate
from rigsight.simulate.model import Model
from rigsight.workflow.blind_files import RUN_FILE, BenchFolder, read_json
from rigsight.workflow.diagnose import DIAGNOSIS_FILE
from rigsight.workflow.model_file import read_model
from rigsight.workflow.results import json_text

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
"""What a diagnosing process needs of its surroundings; nothing else of them reaches it."""
_START = "from rigsight.cli import main; main()"
_FAILURES = (1, 2)
"""Exit codes of a diagnosis that ended by itself; any other end says nothing about the trial."""


def make_trial(folder: BenchFolder, design: Design, seed: int, number: int) -> None:
    """Draw a trial and write it, unless that has been done.

    Raises
    ------
    RigsightError
        If it cannot be drawn or written.
    """
    if not folder.drawn(number):
        folder.write_trial(number, draw_trial(design, seed, number))


def diagnose_trial(folder: BenchFolder, number: int, start: tuple[str, ...] = ("-c", _START)) -> None:
    """Diagnose a trial in a process of its own, unless that has been done.

    The process works on a copy in a temporary folder, so that not even a path tells which trial it is or where keys are.

    Parameters
    ----------
    folder
        The bench.
    number
        Number of the trial.
    start
        How Python starts the command line.

    Raises
    ------
    RigsightError
        If the process was ended from outside.
    """
    if folder.diagnosed(number):
        return
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="rigsight-") as place:
        shutil.copytree(folder.campaign(number), Path(place) / "campaign")
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
        if run.returncode not in (0, *_FAILURES):
            raise RigsightError(
                f"The diagnosis of trial {number} was ended from outside (exit code {run.returncode}); "
                "the same command takes the bench up again."
            )
        seconds = time.perf_counter() - begin
        _keep(Path(place) / "results", folder.result(number), seconds, run.stderr if run.returncode else "")


def _environment() -> dict[str, str]:
    kept = {name: os.environ[name] for name in _KEPT_VARIABLES if name in os.environ}
    return {**kept, "OPENBLAS_NUM_THREADS": "1"}


def _keep(found: Path, target: Path, seconds: float, message: str) -> None:
    """Move results into the bench so that they appear there as a whole."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".part-", dir=target.parent) as part:
        place = Path(part) / "results"
        if found.is_dir():
            shutil.copytree(found, place)
        else:
            place.mkdir()
        (place / RUN_FILE).write_text(
            json_text({"seconds": round(seconds, 2), "message": message.strip()}), encoding="utf-8"
        )
        if target.exists():
            shutil.rmtree(target)
        place.rename(target)


def score_trial(folder: BenchFolder, number: int) -> Outcome:
    """Open the key of a diagnosed trial and hold the diagnosis against it.

    Raises
    ------
    InputError
        If key or results cannot be read.
    """
    key = read_json(folder.key(number))
    run = read_json(folder.result(number) / RUN_FILE)
    diagnosis, held_out = None, None
    if not run["message"]:
        diagnosis = read_json(folder.result(number) / DIAGNOSIS_FILE)
        held_out = _held_out_error(folder, number, key)
    return outcome(key, diagnosis, held_out, float(run["seconds"]), str(run["message"]))


def _held_out_error(folder: BenchFolder, number: int, key: dict[str, Any]) -> float | None:
    """Return the RMS error of the diagnosed model on the withheld records, in units of the true noise floor."""
    model = read_model(folder.result(number))
    rig = model.structure.rig
    squares = []
    for name, hold in key["withheld"].items():
        record = read_record(folder.withheld(number, name), rig.inputs, rig.outputs, hold=hold)
        try:
            residuals = _residuals(model, record, key["noise_floor"])
        except SimulationError:
            return None
        squares.append(
            np.concatenate([residuals[s.name] / key["noise_floor"][s.name] for s in rig.outputs]) ** 2
        )
    return math.sqrt(float(np.mean(np.concatenate(squares))))


def _residuals(model: Model, record: Record, noise: dict[str, float]) -> dict[str, Any]:
    """Return measured minus predicted by output, from the input alone.

    The phase of a disturbance from outside is in no input: where the model has one, the initial state is estimated.
    """
    names = [signal.name for signal in model.structure.rig.outputs]
    if not any(effect.place is Place.DISTURBANCE for effect in model.effects):
        simulated = simulate(model.structure, model.values, record)
        return {name: record[name] - simulated[name] for name in names}
    scales = characteristic_scales(model.structure.rig, [record], model.values)
    fit = GreyBoxFit(model.structure, [record], scales, noise).fit(model.values, [])
    if not fit.residuals:
        raise SimulationError(fit.message)
    return dict(zip(names, fit.residuals[0].T, strict=True))
