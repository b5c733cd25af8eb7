"""What a report was made of, so that it can be made again: the command, where it ran, its inputs, and what came out."""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from rigsight.campaign import Campaign
from rigsight.diagnose import Diagnosis
from rigsight.json_data import json_data
from rigsight.records import Record
from rigsight.workflow.run.results import versions

RESULTS = ("verdict", "effects", "where", "probability", "gap", "families")
"""Keys of ``diagnosis.json`` that are compared."""


def origin(
    campaign: Campaign, diagnosis: Diagnosis, command: str, out: Path, by: str
) -> dict[str, Any] | None:
    """Return what a report carries about itself; None for a campaign without files.

    Parameters
    ----------
    campaign
        The campaign that was diagnosed.
    diagnosis
        Its diagnosis.
    command
        The command as typed.
    out
        Folder of the report.
    by
        Who made it; empty for nobody in particular.
    """
    if campaign.path is None:
        return None
    content = diagnosis.to_json()
    return {
        "command": command,
        # From the folder of the report: both may be moved together.
        "ran_in": os.path.relpath(Path.cwd(), out.resolve()),
        "campaign": os.path.relpath(campaign.path.resolve(), out.resolve()),
        "by": by,
        "versions": versions(),
        "inputs": digests(campaign.path.resolve().parent, _inputs(campaign.path, campaign.records)),
        "results": dict(json_data({key: content[key] for key in RESULTS})),
    }


def digests(folder: Path, names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of files of a folder by their name, empty for one that cannot be read."""
    found = {}
    for name in names:
        try:
            with (folder / name).open("rb") as file:
                found[name] = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError:
            found[name] = ""
    return found


def _inputs(campaign: Path, records: Iterable[Record]) -> Iterator[str]:
    """Yield the files of a campaign, as they are called from its folder."""
    yield campaign.name
    rig_file = tomllib.loads(campaign.read_text("utf-8-sig")).get("rig", {}).get("file")
    if rig_file:
        yield rig_file
    sources = [record.source.resolve() for record in records if record.source is not None]
    yield from dict.fromkeys(os.path.relpath(source, campaign.resolve().parent) for source in sources)
