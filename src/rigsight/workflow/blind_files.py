"""Where does a blind bench keep campaigns, keys and results, so that a diagnosis sees the first alone?

=====================  ==========================================================================
``campaigns/NNN/``     ``campaign.toml`` and records: all that a diagnosis gets
``keys/``              the sealed keys ``NNN.json`` with the records withheld from every diagnosis
``results/NNN/``       what the diagnosis left, with its time; or why it failed
``blind.json``         the score
=====================  ==========================================================================
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.blind import Design, Trial
from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.workflow.results import json_text, write_together

SETTINGS_FILE = "bench.json"
RUN_FILE = "run.json"
_OWNER_ONLY = 0o700


@dataclass(frozen=True)
class BenchFolder:
    """The folder of one bench."""

    path: Path

    def campaign(self, trial: int) -> Path:
        """Return the folder that a diagnosis gets."""
        return self.path / "campaigns" / f"{trial:03d}"

    @property
    def keys(self) -> Path:
        """The folder that no diagnosis gets."""
        return self.path / "keys"

    def key(self, trial: int) -> Path:
        """Return the key of a trial."""
        return self.keys / f"{trial:03d}.json"

    def withheld(self, trial: int, name: str) -> Path:
        """Return a record that is withheld from every diagnosis."""
        return self.keys / f"{trial:03d}_{name}.csv"

    def result(self, trial: int) -> Path:
        """Return the folder of what a diagnosis left."""
        return self.path / "results" / f"{trial:03d}"

    def drawn(self, trial: int) -> bool:
        """Return True if a trial has been drawn: its key is written last."""
        return self.key(trial).is_file()

    def diagnosed(self, trial: int) -> bool:
        """Return True if a trial has been diagnosed: its folder appears as a whole."""
        return (self.result(trial) / RUN_FILE).is_file()

    def settle(self, design: Design, seed: int) -> None:
        """Write down which bench this folder holds, or check that it is this one.

        Raises
        ------
        InputError
            If the folder holds another bench.
        """
        wanted = {"schema_version": 1, "design": design, "seed": seed}
        file = self.keys / SETTINGS_FILE
        if file.exists():
            found = read_json(file)
            if found != wanted:
                raise InputError(
                    f"{self.path} holds a blind bench with design {found.get('design')} and seed {found.get('seed')}, "
                    f"asked for are {design} and {seed}. Name another folder with --out."
                )
            return
        write_together(self.keys, {SETTINGS_FILE: json_text(wanted)})
        self.keys.chmod(_OWNER_ONLY)

    def write_trial(self, number: int, trial: Trial) -> None:
        """Write campaign and withheld records, and the key behind them.

        Raises
        ------
        InputError
            If they cannot be written.
        """
        files = {"campaign.toml": _campaign_toml(trial)}
        files |= {f"{record.name}.csv": _csv_text(trial, record) for record in trial.records}
        write_together(self.campaign(number), files)
        withheld = {self.withheld(number, r.name).name: _csv_text(trial, r) for r in trial.withheld}
        holds = {record.name: record.hold for record in trial.withheld}
        write_together(self.keys, withheld)
        write_together(self.keys, {self.key(number).name: json_text({**trial.key, "withheld": holds})})


def read_json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file of the bench.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file} cannot be read: {error}. Remove it, and the bench makes it anew.") from None
    if not isinstance(content, dict):
        raise InputError(f"{file} holds no JSON object. Remove it, and the bench makes it anew.")
    return content


def _csv_text(trial: Trial, record: Record) -> str:
    names = [signal.name for signal in (*trial.linear.rig.inputs, *trial.linear.rig.outputs)]
    rows = np.column_stack([record.t, *(record[name] for name in names)])
    lines = [",".join(("t", *names)), *(",".join(f"{value:.9e}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _campaign_toml(trial: Trial) -> str:
    """Return the same lines for every trial on one rig: only numbers differ."""
    rig = trial.linear.rig
    constants = "\n".join(f"{p.name} = {trial.linear.values[p.name]!r}" for p in rig.constants)
    parameters = "\n".join(f"{p.name} = {trial.given[p.name]!r}" for p in rig.parameters)
    records = "\n".join(
        f'''
[[records]]
file = "{record.name}.csv"
role = "{record.role}"
kind = "{record.kind}"
amplitude = {record.amplitude!r}
hold = "{record.hold}"'''
        for record in trial.records
    )
    return f'''title = "Trial"

[rig]
model = "{rig.name}"

[rig.constants]
{constants}

[rig.parameters]
{parameters}
{records}
'''
