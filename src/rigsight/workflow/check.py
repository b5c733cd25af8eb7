"""The work of `rigsight check`: a campaign -> what its records can show, before anything is fitted."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from rigsight.campaign import Campaign
from rigsight.check import Check
from rigsight.check.campaign_check import PARTS, check_campaign
from rigsight.effects import CATALOGUE, Effect
from rigsight.report.check import render_check
from rigsight.rigs import Rig
from rigsight.workflow.campaign.in_memory import campaign_of_rig, is_rig_file
from rigsight.workflow.campaign.read_campaign import read_campaign
from rigsight.workflow.own.own_effects import candidates_of
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import check_writable, json_text, versions, write_together

CHECK_FILE, CHECK_PAGE = "check.json", "check.html"


def run_check(
    campaign: str | Path,
    out: Path,
    *,
    effects: Sequence[Effect] = CATALOGUE,
    own_effects: Sequence[Effect] = (),
    own_rigs: Iterable[Rig] = (),
    listener: Listener = silent,
    command: str = "",
) -> Check:
    """Return what the records of a campaign, or a simulated sweep of a rig file, can show, and write it into a folder."""
    check_writable(out, CHECK_FILE, CHECK_PAGE)
    path = Path(campaign)
    is_rig = is_rig_file(path)
    read = campaign_of_rig(path) if is_rig else read_campaign(path, own_effects, own_rigs)
    found = check_of(read, effects, listener)
    if is_rig:
        # What is noted of the simulated sweep says nothing of records to come.
        kept = (r for r in found.remarks if r.severity != "note" or r.sentence in read.notes)
        found = replace(found, remarks=tuple(kept))
    write_together(out, check_files(found, command))
    return found


def check_of(campaign: Campaign, effects: Sequence[Effect] = CATALOGUE, listener: Listener = silent) -> Check:
    """Return what the records of a campaign can show."""
    stage = Stage("Checking", len(PARTS), listener)
    return check_campaign(campaign, candidates_of(campaign, effects), stage.finished)


def check_files(found: Check, command: str) -> dict[str, str]:
    """Return the files of a check by name."""
    page = render_check(found, command, versions())
    return {CHECK_FILE: json_text(found.to_json()), CHECK_PAGE: page}
