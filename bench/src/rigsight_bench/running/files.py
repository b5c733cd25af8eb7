"""The folders of a blind bench: campaigns, keys and results; a diagnosis gets only the campaign.

=====================  ==========================================================================
``campaigns/NNN/``     ``campaign.toml`` and records: all that a diagnosis gets
``keys/``              the sealed keys ``NNN.json`` with the records withheld from every diagnosis
``results/NNN/``       what the diagnosis left, with its time; or why it failed
``trials.sqlite``      the outcome of every scored trial
``blind.json``         the score, and ``blind.html`` the same as a page
=====================  ==========================================================================

A bench of existing campaigns has only the last three entries; there `NNN` is the name of the campaign.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigsight.errors import InputError
from rigsight.records import Record
from rigsight.rigs import Rig
from rigsight.workflow.campaign.campaign_file import RecordTable
from rigsight.workflow.campaign.read_campaign import file_inside, read_listed_record
from rigsight.workflow.run.results import json_text, write_together
from rigsight_bench.trials import Design, Trial

STORE_FILE = "trials.sqlite"
SETTINGS_FILE = "bench.json"
RUN_FILE = "run.json"
EXTERNAL = "external"
"""Design of a bench whose campaigns were written by somebody else."""
_OWNER_ONLY = 0o700
_RIG_FILE = "rig.toml"


@dataclass(frozen=True)
class BenchFolder:
    """The folder of one bench."""

    path: Path

    def campaign(self, trial: str) -> Path:
        """Return the folder that a diagnosis gets."""
        return self.path / "campaigns" / trial

    @property
    def keys(self) -> Path:
        """The folder that no diagnosis gets."""
        return self.path / "keys"

    def key(self, trial: str) -> Path:
        """Return the key of a trial."""
        return self.keys / f"{trial}.json"

    def result(self, trial: str) -> Path:
        """Return the folder of the results of a diagnosis."""
        return self.path / "results" / trial

    @property
    def settings(self) -> Path:
        """The file that says which bench this is."""
        return self.path / "keys" / SETTINGS_FILE

    def fingerprint(self, trial: str) -> str:  # noqa: ARG002
        """Return the hash that distinguishes a campaign and its key from others of the same name; empty for drawn trials."""
        return ""

    def drawn(self, trial: str) -> bool:
        """Return True if a trial has been drawn: its key is written last."""
        return self.key(trial).is_file()

    def diagnosed(self, trial: str) -> bool:
        """Return True if a trial has been diagnosed: its folder appears as a whole."""
        return (self.result(trial) / RUN_FILE).is_file()

    def all_diagnosed(self) -> list[str]:
        """Return the trials that have been diagnosed, in order."""
        results = self.path / "results"
        names = sorted(folder.name for folder in results.iterdir()) if results.is_dir() else []
        found = [name for name in names if not name.startswith(".") and self.diagnosed(name)]
        return sorted(found, key=lambda name: (int(name) if name.isdecimal() else 0, name))

    def read_key(self, trial: str) -> dict[str, Any]:
        """Return the truth about a trial as `draw_trial` makes it, and what is listed of its withheld records.

        Raises
        ------
        InputError
            If the key cannot be read.
        """
        key = read_json(self.key(trial))
        withheld = key["withheld"]
        if isinstance(withheld, dict):
            # Keys of older benches (before trials.sqlite) give only the hold: zoh for a step, otherwise a multisine.
            withheld = [
                {
                    "file": f"{trial}_{name}.csv",
                    "name": name,
                    "kind": "step" if hold == "zoh" else "multisine",
                    "hold": hold,
                }
                for name, hold in withheld.items()
            ]
        return {**key, "trial": trial, "withheld": withheld}

    def withheld_records(self, trial: str, rig: Rig) -> list[Record]:
        """Return the records that are withheld from the diagnosis of a trial.

        Raises
        ------
        InputError
            If one cannot be read.
        """
        path = self.key(trial)
        tables = [RecordTable.model_validate(table) for table in self.read_key(trial)["withheld"]]
        return [
            record
            for number, table in enumerate(tables, 1)
            for record in read_listed_record(path, rig, number, table, file_inside(path, number, table))
        ]

    def settle(self, design: Design, seed: int, measured: Path | None = None) -> None:
        """Write down which bench this folder holds, or check that it is this one.

        Parameters
        ----------
        design, seed
            Of the bench.
        measured
            Folder of the campaigns of design ``measured``.

        Raises
        ------
        InputError
            If the folder holds another bench.
        """
        wanted: dict[str, Any] = {"schema_version": 1, "design": design, "seed": seed}
        if measured is not None:
            wanted["folder"] = str(measured.resolve())
        if self.settings.exists():
            found = read_json(self.settings)
            if found != wanted:
                raise InputError(
                    f"{self.path} already contains a blind bench with {described(found)}; the command asks for one with "
                    f"{described(wanted)}. Name another folder with --out."
                )
            return
        write_together(self.settings.parent, {SETTINGS_FILE: json_text(wanted)})
        self.keys.chmod(_OWNER_ONLY)

    def write_trial(self, name: str, trial: Trial) -> None:
        """Write the campaign and the withheld records, and the key last.

        Raises
        ------
        InputError
            If they cannot be written.
        """
        files = {"campaign.toml": _campaign_toml(trial)}
        files |= {f"{record.name}.csv": _csv_text(trial, record) for record in trial.records}
        if trial.rig_file is not None:
            files[_RIG_FILE] = trial.rig_file
        write_together(self.campaign(name), files)
        withheld = {f"{name}_{record.name}.csv": record for record in trial.withheld}
        write_together(self.keys, {file: _csv_text(trial, record) for file, record in withheld.items()})
        listed = [
            {
                "file": file,
                "name": record.name,
                "kind": record.kind,
                "amplitude": record.amplitude,
                "hold": record.hold,
            }
            for file, record in withheld.items()
        ]
        write_together(self.keys, {self.key(name).name: json_text({**trial.key, "withheld": listed})})


def trial_name(number: int) -> str:
    """Return what a drawn trial is called in files."""
    return f"{number:03d}"


def described(settings: dict[str, Any]) -> str:
    """Return which bench it is, in words."""
    if settings.get("design") == EXTERNAL:
        return "existing campaigns"
    of_folder = f" of {settings['folder']}" if "folder" in settings else ""
    return f"design {settings.get('design')}{of_folder} and seed {settings.get('seed')}"


def read_json(file: Path) -> dict[str, Any]:
    """Return the content of a JSON file of the bench.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"{file} cannot be read: {error}. Remove it; the bench then writes it again."
        ) from None
    if not isinstance(content, dict):
        raise InputError(f"{file} does not contain a JSON object. Remove it; the bench then writes it again.")
    return content


def _csv_text(trial: Trial, record: Record) -> str:
    signals = (*trial.rig.inputs, *trial.rig.outputs)
    names = [signal.name for signal in signals if signal.name in record]
    rows = np.column_stack([record.t, *(record[name] for name in names)])
    lines = [",".join(("t", *names)), *(",".join(f"{value:.9e}" for value in row) for row in rows)]
    return "\n".join(lines) + "\n"


def _amplitude_line(record: Record) -> str:
    """Return the line of the amplitude; empty for a record without input."""
    return "" if record.amplitude is None else f"\namplitude = {record.amplitude!r}"


def _constants_line(record: Record) -> str:
    """Return the line of the constants of a record alone; empty where it has none."""
    own = ", ".join(f"{name} = {value!r}" for name, value in record.constants.items())
    return f"\nconstants = {{ {own} }}" if own else ""


def _given(trial: Trial) -> dict[str, float]:
    """Return the numbers of the given simulation, those of the rig in the order of its declaration."""
    of_rig = [p.name for p in trial.rig.parameters if p.name in trial.given]
    return {name: trial.given[name] for name in [*of_rig, *(n for n in trial.given if n not in of_rig)]}


def _campaign_toml(trial: Trial) -> str:
    """Return the text of campaign.toml; for trials on one rig only the values differ."""
    rig = trial.rig
    of_records = {name for record in trial.records for name in record.constants}
    constants = "\n".join(
        f"{p.name} = {trial.values[p.name]!r}" for p in rig.constants if p.name not in of_records
    )
    parameters = "\n".join(f"{name} = {value!r}" for name, value in _given(trial).items())
    records = "\n".join(
        f'''
[[records]]
file = "{record.name}.csv"
role = "{record.role}"
kind = "{record.kind}"{_amplitude_line(record)}
hold = "{record.hold}"{_constants_line(record)}'''
        for record in trial.records
    )
    which = f'model = "{rig.name}"' if trial.rig_file is None else f'file = "{_RIG_FILE}"'
    effects = f"\neffects = {json.dumps(list(trial.modelled))}" if trial.modelled else ""
    offsets = '\noffsets = "per_record"' if trial.offsets_by_record else ""
    return f'''title = "Trial"{offsets}

[rig]
{which}{effects}

[rig.constants]
{constants}

[rig.parameters]
{parameters}
{records}
'''
