"""The campaigns that the cheat examines: 108 drawn trials that were not diagnosed."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rigsight_bench.running.files import BenchFolder, trial_name
from rigsight_bench.running.trial import make_trial
from rigsight_bench.trials import n_trials
from rigsight_bench.trials.standard.subjects import standard_subject_of

SEED = 6
FIRST = 100
FOLDER = Path("out/blind-cheat")
REST = 1000
"""Samples of the step's record before the step."""


@dataclass(frozen=True)
class Campaign:
    """What one diagnosis gets, and what was hidden from it.

    Attributes
    ----------
    number
        Number of the trial.
    key
        Its key.
    folder
        What the diagnosis gets.
    text
        Its campaign.toml.
    content
        The same, read.
    """

    number: int
    key: dict[str, Any]
    folder: Path
    text: str
    content: dict[str, Any]

    @property
    def rig(self) -> str:
        return str(self.content["rig"]["model"])

    def cells(self, record: int) -> NDArray[np.bytes_]:
        """Return the texts of a record's numbers, shape (n_samples, n_columns)."""
        header, body = (self.folder / f"record_{record}.csv").read_bytes().split(b"\n", 1)
        texts = np.array(body.replace(b"\n", b",").rstrip(b",").split(b","))
        return texts.reshape(-1, header.count(b",") + 1)


def campaigns() -> list[Campaign]:
    bench = BenchFolder(FOLDER)
    bench.settle("standard", SEED)
    controls = ("none", "parameters")
    numbers = [
        n for n in range(n_trials("standard")) if n < FIRST or standard_subject_of(SEED, n).kind in controls
    ]
    found = []
    for number in numbers:
        make_trial(bench, "standard", SEED, number)
        folder = bench.campaign(trial_name(number))
        text = (folder / "campaign.toml").read_text()
        key = bench.read_key(trial_name(number))
        found.append(Campaign(number, key, folder, text, tomllib.loads(text)))
    return found
