"""The table of training trials, a row each, as a file of comma-separated values."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from rigsight.diagnose.verdict.calibration import Situation
from rigsight_bench.scoring.training_trial import TrainingTrial

FILE = Path(__file__).parent / "trials.csv"
_OF_SITUATION = (
    "verdict",
    "first_share",
    "remainder",
    "gap",
    "n_effects",
    "adequate",
    "lower_bound",
    "several_places",
)
_OF_TRIAL = ("design", "seed", "trial", "kind", "left_out")
_COLUMNS = (*_OF_TRIAL, *_OF_SITUATION, "cause", "share_of_cause")


def write_table(trials: Iterable[TrainingTrial], path: Path = FILE) -> None:
    """Write the trials in the order of design, seed and number."""
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, _COLUMNS, lineterminator="\n")
        writer.writeheader()
        for trial in sorted(trials, key=lambda t: (t.design, t.seed, t.trial, t.left_out)):
            row = asdict(trial)
            row |= row.pop("situation")
            writer.writerow({name: _written(row[name]) for name in _COLUMNS})


def read_table(path: Path = FILE) -> list[TrainingTrial]:
    """Return the trials of a table."""
    with path.open(encoding="utf-8", newline="") as file:
        return [_trial(row) for row in csv.DictReader(file)]


def _written(value: object) -> object:
    if isinstance(value, bool):
        return int(value)
    return f"{value:.6g}" if isinstance(value, float) else value


def _trial(row: dict[str, str]) -> TrainingTrial:
    return TrainingTrial(
        row["design"],
        int(row["seed"]),
        row["trial"],
        row["kind"],
        row["left_out"] == "1",
        Situation(
            row["verdict"],
            float(row["first_share"]),
            float(row["remainder"]),
            float(row["gap"]),
            int(row["n_effects"]),
            row["adequate"] == "1",
            row["lower_bound"] == "1",
            row["several_places"] == "1",
        ),
        row["cause"],
        float(row["share_of_cause"]),
    )


def is_judgeable(trial: TrainingTrial) -> bool:
    """Return True if the figures of a trial are finite: a model that could not be scored tells nothing."""
    return math.isfinite(trial.situation.remainder) and math.isfinite(trial.situation.gap)
