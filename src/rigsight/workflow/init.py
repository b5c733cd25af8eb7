"""The work of `rigsight init`: measured files -> a commented `campaign.toml`; the model of a robot -> also its rig file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rigsight.errors import InputError, check_option
from rigsight.rigs import RIGS, Rig
from rigsight.robots import FreeRun, RigDraft, free_run, read_robot, rig_text, with_gears
from rigsight.workflow.campaign.campaign_draft import (
    MEASURED_SUFFIXES,
    campaign_text,
    measured_files,
    proposed_records,
)
from rigsight.workflow.campaign.campaign_file import MOST_RECORDS
from rigsight.workflow.own.own_rigs import own_rigs
from rigsight.workflow.run.progress import Listener, Stage, silent
from rigsight.workflow.run.results import write_together

CAMPAIGN_FILE = "campaign.toml"


@dataclass(frozen=True, eq=False)
class Draft:
    """A written campaign."""

    path: Path  # the file
    model: str  # the rig that matches the channels best
    records: tuple[str, ...]  # files taken as records
    left_out: tuple[tuple[str, str], ...]  # other measured files, and why they were not taken
    n_blanks: int  # values that are left to be filled in
    others: tuple[str, ...] = ()  # rigs that it was chosen from, where it is a guess


@dataclass(frozen=True, eq=False)
class ModelDraft:
    """A written rig file."""

    path: Path  # the rig file
    draft: RigDraft  # its contents, and what it leaves out
    run: FreeRun  # its free run compared with MuJoCo
    campaign: Draft | None  # the campaign in the same folder; None if the folder contains no records yet


def run_init(
    folder: str | Path,
    *,
    model: str | None = None,
    rig_files: Iterable[Path] = (),
    values: Mapping[str, float] | None = None,
) -> Draft:
    """Write a `campaign.toml` for the measured files of a folder, and a copy of a rig file from elsewhere beside it."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} is not a folder; name the folder of the measured files.")
    path = folder / CAMPAIGN_FILE
    if path.exists() or path.is_symlink():
        raise InputError(f"{path} exists already and is not overwritten; remove it, or edit it by hand.")
    own = own_rigs(rig_files)
    known = {rig.name: rig for rig in (*own.values(), *RIGS.values())}
    if model is not None:
        rigs: tuple[Rig, ...] = (known[check_option("--model", model, known)],)
    else:
        rigs = tuple(own.values()) or tuple(known.values())
    files = measured_files(folder)
    if len(files) > MOST_RECORDS:
        raise InputError(
            f"{folder} contains {len(files)} measured files; a campaign can have at most {MOST_RECORDS}."
        )
    proposals, left_out = proposed_records(files, rigs)
    if not proposals:
        reasons = "".join(f"\n{name}: {reason}" for name, reason in left_out[:5])
        raise InputError(
            f"{folder} contains no usable measured file ({', '.join(MEASURED_SUFFIXES)}).{reasons}"
        )
    rig = proposals[0].guess.rig
    others = () if len(rigs) == 1 else tuple(name for name in known if name != rig.name)
    source = {own_rig.name: file for file, own_rig in own.items()}.get(rig.name)
    beside = {} if source is None else _copied(folder, source)
    inside = source and (folder / source.name if beside else source)
    text, n_blanks = campaign_text(folder, rig, inside, others, values, proposals, left_out)
    write_together(folder, {**beside, CAMPAIGN_FILE: text}, "Free disk space there, or get write permission.")
    return Draft(
        path, rig.name, tuple(proposal.file for proposal in proposals), tuple(left_out), n_blanks, others
    )


def run_init_from_mjcf(
    folder: str | Path,
    model_file: str | Path,
    *,
    gears: Mapping[str, float] | None = None,
    as_it_is: bool = False,
    listener: Listener = silent,
) -> ModelDraft:
    """Write the rig file of a MuJoCo model or URDF, and a campaign if its folder holds measured files."""
    folder, source = Path(folder), Path(model_file)
    robot = read_robot(source, gears, as_it_is=as_it_is)
    draft = robot.draft
    stage = Stage(f"Equations of {len(draft.tables['coordinates'])} coordinates", 2, listener)
    rig = draft.rig
    stage.finished("derived")
    path = folder / f"{rig.name}.toml"
    text = rig_text(draft, source.name, folder)
    # When records have been added, the same command writes the campaign.
    if path.exists() and path.read_text(encoding="utf-8", errors="replace") != text:
        raise InputError(f"{path} exists already and is not overwritten; remove it, or edit it by hand.")
    campaign_file = folder / CAMPAIGN_FILE
    if campaign_file.exists() or campaign_file.is_symlink():
        raise InputError(
            f"{campaign_file} exists already and is not overwritten; remove it, or edit it by hand."
        )
    run = free_run(with_gears(robot.spec, draft), draft)
    stage.finished("compared with MuJoCo")
    write_together(folder, {path.name: text}, "Free disk space there, or get write permission.")
    campaign = None
    if measured_files(folder):
        campaign = run_init(folder, model=rig.name, rig_files=[path], values=draft.values)
    return ModelDraft(path, draft, run, campaign)


def _copied(folder: Path, file: Path) -> dict[str, str]:
    """Return the copy of the rig file for the folder of the campaign; empty if the rig file is already there."""
    if file.resolve().is_relative_to(folder.resolve()):
        return {}
    text, copy = file.read_text(encoding="utf-8"), folder / file.name
    if copy.exists() and copy.read_text(encoding="utf-8", errors="replace") != text:
        raise InputError(
            f"{copy} differs from {file}, which would be copied there. Give {copy.name} of that folder with --rigs, or remove it."
        )
    return {file.name: text}
